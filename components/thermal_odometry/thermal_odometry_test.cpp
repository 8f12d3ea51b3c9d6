#include "components/thermal_odometry/thermal_odometry.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "components/thermal_odometry/fuzzed_frames.hpp"
#include "components/thermal_odometry/test_scene.hpp"

namespace adit::thermal_odometry {
namespace {

constexpr std::int64_t frame_ns = 40'000'000;

std::unique_ptr<ThermalOdometry> make(const TestScene& scene, const Config& config = {}) {
  auto result = ThermalOdometry::create(scene.camera, config);
  EXPECT_TRUE(result);
  return std::move(result).value();
}

// Drives along the corridor with a cloud every third frame and compares with the truth.
struct Drive {
  TestScene scene;
  double speed = 4.0;
  int lidar_from = 0;
  int lidar_to = 1 << 30;
  std::unique_ptr<ThermalOdometry> odometry;
  Pose first = TestScene::drive(0.0, 4.0);

  Pose truth(int i) const { return first.inverse() * TestScene::drive(0.04 * i, speed); }
  const Estimate& step(int i) {
    const Pose pose = TestScene::drive(0.04 * i, speed);
    const bool scan = i % 3 == 0 && i >= lidar_from && i < lidar_to;
    const DepthPoints cloud = scan ? scene.scan(pose, i * frame_ns) : DepthPoints{};
    return odometry->process(scene.render(pose, i * frame_ns), nullptr, scan ? &cloud : nullptr);
  }
  double error(int i) const {
    return (odometry->estimate().T_odom_camera.translation() - truth(i).translation()).norm();
  }
};

TEST(ThermalOdometry, AnchoredIsMetricFromTheFirstFrame) {
  Drive drive;
  drive.odometry = make(drive.scene);
  EXPECT_EQ(drive.step(0).status, Status::tracking);
  for (int i = 1; i <= 125; ++i) {
    const Estimate& estimate = drive.step(i);
    ASSERT_EQ(estimate.status, Status::tracking) << "frame " << i;
    ASSERT_TRUE(estimate.measured);
    EXPECT_EQ(estimate.scale, ScaleState::metric);
  }
  const double path = drive.speed * 5.0;
  EXPECT_LT(drive.error(125), 0.005 * path);
  EXPECT_LT(
      so3_log(drive.odometry->estimate().T_odom_camera.rotation().transpose() * drive.truth(125).rotation()).norm(),
      0.01);
  EXPECT_LT(drive.odometry->estimate().counters.keyframes, 25U);
  RecordProperty("end_error_percent", std::to_string(100.0 * drive.error(125) / path));
}

TEST(ThermalOdometry, FrozenFramesGiveNothingAndAreSurvived) {
  Drive drive;
  drive.odometry = make(drive.scene);
  int i = 0;
  for (; i <= 40; ++i) drive.step(i);
  const double before = drive.error(40);
  // Shutter closed for 0.5 s: the last picture again, then an offset jump and a new fixed pattern.
  std::vector<std::uint16_t> repeated(320 * 256);
  const Frame last = drive.scene.render(TestScene::drive(0.04 * i, drive.speed), i * frame_ns);
  std::copy(last.data, last.data + repeated.size(), repeated.begin());
  Frame frame{repeated.data(), 320, 256, 0, i * frame_ns, FfcState::unknown};
  drive.odometry->process(frame);
  for (++i; i < 53; ++i) {
    frame.stamp_ns = i * frame_ns;
    const Estimate& estimate = drive.odometry->process(frame);
    EXPECT_EQ(estimate.status, Status::frozen) << "frame " << i;
    EXPECT_FALSE(estimate.measured);
  }
  drive.scene.offset = 75.0;
  drive.scene.new_fixed_pattern(1.5F);
  const int live = i;
  int recovered = -1;
  for (; i < live + 25; ++i) {
    const Estimate& estimate = drive.step(i);
    if (recovered < 0 && estimate.status == Status::tracking) recovered = i;
  }
  EXPECT_GE(recovered, live);
  EXPECT_LE(recovered, live + 5);
  EXPECT_LT(drive.error(i - 1), before + 0.02 * (13 * 0.04 * drive.speed) + 0.003 * drive.speed);
}

TEST(ThermalOdometry, PriorLeadsThroughAFastTurn) {
  const double rate = 2.2;  // rad/s: 18 px a frame, and it starts at once
  const auto pose_at = [&](int i) {
    Pose T = TestScene::drive(0.04 * i, 2.0);
    T.linear() = so3_exp(Eigen::Vector3d(0, i > 10 ? rate * 0.04 * std::min(i - 10, 5) : 0.0, 0)) * T.linear();
    return T;
  };
  Drive drive;
  drive.odometry = make(drive.scene);
  for (int i = 0; i <= 20; ++i) {
    const DepthPoints cloud = drive.scene.scan(pose_at(i), i * frame_ns);
    Prior prior;
    if (i > 0) prior.T_previous_current = pose_at(i - 1).inverse() * pose_at(i);
    prior.covariance = 1e-4 * Matrix6d::Identity();
    const Estimate& estimate = drive.odometry->process(drive.scene.render(pose_at(i), i * frame_ns), &prior, &cloud);
    ASSERT_EQ(estimate.status, Status::tracking) << "frame " << i;
  }
  EXPECT_LT(
      (drive.odometry->estimate().T_odom_camera.translation() - (pose_at(0).inverse() * pose_at(20)).translation())
          .norm(),
      0.05);
}

TEST(ThermalOdometry, WithoutLidarTheScaleIsCarriedAndComesBack) {
  Drive drive;
  drive.speed = 3.0;
  drive.first = TestScene::drive(0.0, drive.speed);
  drive.lidar_to = 30;
  drive.odometry = make(drive.scene);
  for (int i = 0; i <= 30; ++i) drive.step(i);
  EXPECT_EQ(drive.odometry->estimate().scale, ScaleState::metric);
  double last_sigma = 0.0;
  for (int i = 31; i < 120; ++i) {
    const Estimate& estimate = drive.step(i);
    ASSERT_EQ(estimate.status, Status::tracking) << "frame " << i;
    last_sigma = estimate.log_scale_sigma;
  }
  EXPECT_EQ(drive.odometry->estimate().scale, ScaleState::carried);
  EXPECT_GT(last_sigma, 0.005);
  EXPECT_LT(drive.error(119), 0.03 * 89 * 0.04 * drive.speed + 0.03);
  RecordProperty("outage_error_percent", std::to_string(100.0 * drive.error(119) / (89 * 0.04 * drive.speed)));
  drive.lidar_from = 120;
  drive.lidar_to = 1 << 30;
  int metric = -1;
  for (int i = 120; i < 146; ++i) {
    if (drive.step(i).scale == ScaleState::metric && metric < 0) metric = i;
  }
  EXPECT_GE(metric, 120);
  EXPECT_LE(metric, 145);  // within a second
}

TEST(ThermalOdometry, MonocularFindsTheShapeOfThePath) {
  Drive drive;
  drive.speed = 2.5;
  drive.first = TestScene::drive(0.0, drive.speed);
  drive.lidar_to = 0;
  Config config;
  config.mode = Mode::mono;
  drive.odometry = make(drive.scene, config);
  int first = -1;
  int last = 0;
  Pose at_first;
  for (int i = 0; i < 90; ++i) {
    const Estimate& estimate = drive.step(i);
    EXPECT_NE(estimate.scale, ScaleState::metric);
    if (estimate.status != Status::tracking) continue;
    if (first < 0) {
      first = i;
      at_first = estimate.T_odom_camera;
    }
    last = i;
  }
  ASSERT_GE(first, 0);
  EXPECT_LE(first, 15);
  EXPECT_EQ(last, 89);
  const Pose moved = at_first.inverse() * drive.odometry->estimate().T_odom_camera;
  const Pose truth = drive.truth(first).inverse() * drive.truth(89);
  const double scale = truth.translation().norm() / moved.translation().norm();
  EXPECT_LT((scale * moved.translation() - truth.translation()).norm(), 0.02 * truth.translation().norm());
}

TEST(ThermalOdometry, NoTextureIsSaid) {
  Drive drive;
  drive.scene.contrast = 0.0;
  drive.odometry = make(drive.scene);
  for (int i = 0; i < 10; ++i) {
    const Estimate& estimate = drive.step(i);
    EXPECT_EQ(estimate.status, Status::low_texture);
    EXPECT_FALSE(estimate.measured);
  }
}

TEST(ThermalOdometry, AWallOfFogIsRecoveredFrom) {
  Drive drive;
  drive.odometry = make(drive.scene);
  for (int i = 0; i <= 30; ++i) drive.step(i);
  drive.scene.contrast = 0.0;
  int measured = 0;
  for (int i = 31; i <= 50; ++i) measured += drive.step(i).measured ? 1 : 0;
  EXPECT_LE(measured, 2);
  drive.scene.contrast = 1.0;
  Status last = Status::recovering;
  for (int i = 51; i <= 60; ++i) last = drive.step(i).status;
  EXPECT_EQ(last, Status::tracking);
}

TEST(ThermalOdometry, SameInputSameBits) {
  const auto run = [] {
    Drive drive;
    drive.odometry = make(drive.scene);
    Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
    for (int i = 0; i < 30; ++i) sum += drive.step(i).T_odom_camera.matrix();
    return sum;
  };
  EXPECT_TRUE((run().array() == run().array()).all());
}

TEST(ThermalOdometry, RefusesAWrongCalibration) {
  TestScene scene;
  scene.camera.fx = 0.0;
  EXPECT_FALSE(ThermalOdometry::create(scene.camera, {}));
}

TEST(ThermalOdometry, SurvivesFuzzedFrames) {
  survive_fuzzed_frames(100, 11);
}

}  // namespace
}  // namespace adit::thermal_odometry
