#include "components/thermal_odometry/tracker.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "components/thermal_odometry/depth_anchor.hpp"
#include "components/thermal_odometry/frame_aligner.hpp"
#include "components/thermal_odometry/front_end.hpp"
#include "components/thermal_odometry/selection.hpp"
#include "components/thermal_odometry/test_scene.hpp"
#include "components/thermal_odometry/thermal_odometry.hpp"

namespace adit::thermal_odometry {
namespace {

struct Bench {
  TestScene scene;
  FrontEnd front_end{scene.camera, {.noise_counts = 2.5F}};
  Pinhole pinhole{scene.camera.fx, scene.camera.fy, scene.camera.cx, scene.camera.cy};
  PixelSelector selector{320, 256, {.wanted = 500}};
  Pyramid key;
  Pyramid current;
  std::vector<Patch> patches;
  std::unique_ptr<Tracker> tracker;

  Bench() {
    key.allocate(320, 256);
    current.allocate(320, 256);
    tracker = std::make_unique<Tracker>(pinhole, key.levels(), 2000, Tracker::Config{});
    front_end.calibrate(scene.render(Pose::Identity(), 0));
    set_key(Pose::Identity());
  }
  void set_key(const Pose& T_world_camera) {
    front_end.process(scene.render(T_world_camera, 0), key);
    patches.clear();
    for (const Pixel& pixel : selector.select(key, front_end.rectifier())) {
      const double depth = scene.depth(T_world_camera, pixel.u, pixel.v);
      if (depth > 60.0) continue;
      Patch patch{pixel.u, pixel.v, static_cast<float>(1.0 / depth), 0, 0, 0.0F, 0};
      patch.slope_u = static_cast<float>(1.0 / scene.depth(T_world_camera, pixel.u + 0.5, pixel.v) -
                                         1.0 / scene.depth(T_world_camera, pixel.u - 0.5, pixel.v));
      patch.slope_v = static_cast<float>(1.0 / scene.depth(T_world_camera, pixel.u, pixel.v + 0.5) -
                                         1.0 / scene.depth(T_world_camera, pixel.u, pixel.v - 0.5));
      patches.push_back(patch);
    }
    const ReferenceView view{{T_world_camera.inverse(), 0.0, 0.0}, &key};
    tracker->set_reference({&view, 1}, patches, 0);
  }
  TrackResult track(const Pose& T_world_camera, const Pose& start, int top = 3) {
    front_end.process(scene.render(T_world_camera, 1), current);
    return tracker->track(current, {start.inverse(), 0.0, 0.0}, top, nullptr);
  }
};

Pose random_motion(std::mt19937& random, double metres, double radians) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi[i] = (i < 3 ? metres : radians) * uniform(random);
  return se3_exp(xi);
}

TEST(Warp, JacobianMatchesFiniteDifferences) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const double f = 417.0;
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Vector3d X(3 * uniform(random), 2 * uniform(random), 6.0 + 4.0 * uniform(random));
    const auto J = pixel_jacobian(static_cast<float>(f), static_cast<float>(f), static_cast<float>(X.x() / X.z()),
                                  static_cast<float>(X.y() / X.z()), static_cast<float>(1.0 / X.z()));
    for (int i = 0; i < 6; ++i) {
      const double h = 1e-6;
      const Eigen::Vector3d plus = se3_exp(Vector6d::Unit(i) * h) * X;
      const Eigen::Vector3d minus = se3_exp(Vector6d::Unit(i) * -h) * X;
      EXPECT_NEAR(J(0, i), f * (plus.x() / plus.z() - minus.x() / minus.z()) / (2 * h), 1e-4 * f);
      EXPECT_NEAR(J(1, i), f * (plus.y() / plus.z() - minus.y() / minus.z()) / (2 * h), 1e-4 * f);
    }
  }
}

// The adjoint chain: moving the host by exp(xi) moves the relative pose by exp(-Ad(T_ji) xi).
TEST(Warp, HostIncrementIsMinusTheAdjoint) {
  std::mt19937 random(2);
  const Pose target = random_motion(random, 2.0, 0.5);
  const Pose host = random_motion(random, 2.0, 0.5);
  const Pose relative = target * host.inverse();
  for (int i = 0; i < 6; ++i) {
    const double h = 1e-6;
    const Pose moved = target * (se3_exp(Vector6d::Unit(i) * h) * host).inverse();
    const Vector6d numeric = se3_log(moved * relative.inverse()) / h;
    EXPECT_LT((numeric + se3_adjoint(relative).col(i)).norm(), 1e-4);
  }
}

TEST(Tracker, FindsTheMotionWithoutBias) {
  Bench bench;
  std::mt19937 random(3);
  ASSERT_GT(bench.patches.size(), 300U);
  Vector6d mean = Vector6d::Zero();
  const int trials = 20;
  for (int trial = 0; trial < trials; ++trial) {
    const Pose truth = random_motion(random, 0.15, 0.015);
    const TrackResult result = bench.track(truth, Pose::Identity());
    ASSERT_TRUE(result.ok) << "trial " << trial;
    const Vector6d error = se3_log(result.state.T_cw * truth);
    EXPECT_LT(error.head<3>().norm(), 0.02) << "trial " << trial;
    EXPECT_LT(error.tail<3>().norm(), 0.0015) << "trial " << trial;
    mean += error / trials;
  }
  EXPECT_LT(mean.head<3>().norm(), 0.004);
  EXPECT_LT(mean.tail<3>().norm() * 210.0, 0.05);  // px
}

TEST(Tracker, ConvergesFromAFarStartOnCoarseLevels) {
  Bench bench;
  const Pose truth = se3_exp((Vector6d() << 0.05, 0.02, 0.6, 0.01, 0.05, 0.02).finished());  // 10 px and more
  const TrackResult result = bench.track(truth, Pose::Identity(), Pyramid::max_levels - 1);
  ASSERT_TRUE(result.ok);
  EXPECT_LT(se3_log(result.state.T_cw * truth).norm(), 0.02);
}

TEST(Tracker, GainAndOffsetAreEstimatedNotMotion) {
  Bench bench;
  const Pose truth = se3_exp((Vector6d() << 0.02, 0.0, 0.1, 0.0, 0.005, 0.0).finished());
  const TrackResult plain = bench.track(truth, Pose::Identity());
  bench.scene.offset = 75.0;  // 1.5 K: the jump of a flat-field correction
  bench.scene.gain = 1.04;
  const TrackResult result = bench.track(truth, Pose::Identity());
  ASSERT_TRUE(result.ok);
  EXPECT_LT(se3_log(result.state.T_cw * truth).norm(), 0.01);
  EXPECT_NEAR(result.state.a - plain.state.a, std::log(1.04), 0.005);
  EXPECT_NEAR(result.state.b - plain.state.b, 75.0 / 2.5, 1.5);
}

TEST(Tracker, CovarianceIsConsistent) {
  Bench bench;
  std::mt19937 random(5);
  double nees = 0.0;
  const int trials = 40;
  for (int trial = 0; trial < trials; ++trial) {
    bench.set_key(TestScene::drive(0.7 * trial, 2.0));
    const Pose truth = TestScene::drive(0.7 * trial, 2.0) * random_motion(random, 0.1, 0.01);
    const TrackResult result = bench.track(truth, TestScene::drive(0.7 * trial, 2.0));
    ASSERT_TRUE(result.ok);
    const Vector6d error = se3_log(result.state.T_cw * truth);
    nees += error.dot(result.information / Config{}.correlation * error) / trials;
  }
  EXPECT_GT(nees, 1.5);
  EXPECT_LT(nees, 12.0);
}

// Half a second without pictures at 5 m/s: where the camera then is must be where some braking could have left it.
TEST(FrameAligner, AfterABlindGapAPlaceNoAccelerationLeadsToIsRefused) {
  Bench bench;
  FrameAligner aligner(FrameAligner::Config{});
  aligner.place(1, Pose::Identity());
  aligner.set_velocity((Vector6d() << 0, 0, -5.0, 0, 0, 0).finished());  // of T_cw
  const auto place_at = [&](double z, const Prior* prior) {
    Pose pose = Pose::Identity();
    pose.translation().z() = z;
    bench.front_end.process(bench.scene.render(pose, 1), bench.current);
    return aligner.align(*bench.tracker, bench.current, 500'000'001, 0.0, prior);
  };
  const FrameAligner::Alignment usual = place_at(2.3, nullptr);
  EXPECT_TRUE(usual.result.ok);
  EXPECT_NEAR(usual.result.state.T_cw.translation().z(), -2.3, 0.02);
  EXPECT_FALSE(place_at(0.2, nullptr).result.ok);
  Prior stood;
  stood.covariance *= 1e-4;
  EXPECT_TRUE(place_at(0.2, &stood).result.ok);  // unless somebody else knows of it
}

TEST(Tracker, RefusesPureNoise) {
  Bench bench;
  bench.scene.contrast = 0.0;
  const TrackResult result = bench.track(Pose::Identity(), Pose::Identity());
  EXPECT_LT(result.inlier_share, 1.0F);
  EXPECT_TRUE(result.state.T_cw.matrix().allFinite());
}

TEST(Selection, TakesGradientsAndLeavesNoise) {
  Bench bench;
  EXPECT_GT(bench.selector.select(bench.key, bench.front_end.rectifier()).size(), 250U);
  bench.scene.contrast = 0.0;
  bench.front_end.process(bench.scene.render(Pose::Identity(), 0), bench.key);
  EXPECT_LT(bench.selector.select(bench.key, bench.front_end.rectifier()).size(), 40U);
}

TEST(DepthAnchor, MeasuresTheWallsFromACloud) {
  Bench bench;
  DepthAnchor anchor(bench.pinhole, 320, 256, 100000, {});
  const DepthPoints cloud = bench.scene.scan(Pose::Identity(), 0);
  std::vector<Eigen::Vector3f> points;
  for (const Eigen::Vector3f& point : cloud.points)
    points.emplace_back((cloud.T_camera_sensor * point.cast<double>()).cast<float>());
  anchor.project(points);
  int found = 0;
  int wrong = 0;
  double squared = 0.0;
  for (const Patch& patch : bench.patches) {
    const auto depth = anchor.depth_at(patch.u, patch.v);
    if (!depth) continue;
    ++found;
    const double relative = depth->inverse_depth / patch.inverse_depth - 1.0;
    if (std::abs(relative) > 0.05)
      ++wrong;
    else
      squared += relative * relative;
  }
  EXPECT_GT(found, static_cast<int>(bench.patches.size() / 2));
  EXPECT_LT(wrong, found / 20);
  EXPECT_LT(std::sqrt(squared / found), 0.015);
}

TEST(DepthAnchor, LeavesOutWhatANearObjectHides) {
  const Pinhole pinhole{210.0, 210.0, 159.5, 127.5};
  DepthAnchor anchor(pinhole, 320, 256, 100000, {});
  std::vector<Eigen::Vector3f> points;
  for (int v = 60; v < 200; v += 3) {
    for (int u = 60; u < 260; u += 3) {
      const float x = (static_cast<float>(u) - 159.5F) / 210.0F;
      const float y = (static_cast<float>(v) - 127.5F) / 210.0F;
      points.emplace_back(20.0F * x, 20.0F * y, 20.0F);  // far wall, seen by the LiDAR past the box
      if (u < 160) points.emplace_back(4.0F * x, 4.0F * y, 4.0F);
    }
  }
  anchor.project(points);
  ASSERT_TRUE(anchor.depth_at(100.0F, 120.0F));
  EXPECT_NEAR(anchor.depth_at(100.0F, 120.0F)->inverse_depth, 0.25F, 1e-3F);
  ASSERT_TRUE(anchor.depth_at(220.0F, 120.0F));
  EXPECT_NEAR(anchor.depth_at(220.0F, 120.0F)->inverse_depth, 0.05F, 1e-3F);
}

}  // namespace
}  // namespace adit::thermal_odometry
