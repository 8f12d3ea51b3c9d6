// Longer drives through the test corridor with exact truth: drift with and without LiDAR, low contrast, a boresight
// error, a time offset, a shutter closure. The bars are those of the design notes, section 18; the figures are printed.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>

#include "components/thermal_odometry/fuzzed_frames.hpp"
#include "components/thermal_odometry/test_scene.hpp"
#include "components/thermal_odometry/thermal_odometry.hpp"

namespace adit::thermal_odometry {
namespace {

struct Case {
  double speed = 5.0;
  double contrast = 1.0;
  double yaw_error_deg = 0.0;
  double time_offset_s = 0.0;
  int frames = 250;  // 25 Hz
  int outage_from = 1 << 30;
  int outage_to = 1 << 30;
  bool bilateral = true;
  bool optimise = true;
};

struct Figures {
  double drift_percent = 0.0;  // end error of the path, nothing aligned but the first pose
  double rotation_deg_per_100m = 0.0;
  double speed_bias_percent = 0.0;  // over 0.2 s steps
  double speed_rms = 0.0;           // m/s
  double outage_percent = 0.0;      // error gathered over the outage
  int measured = 0;
  int keyframes = 0;
};

Figures run(const Case& c, std::uint32_t seed) {
  TestScene scene(seed);
  scene.contrast = c.contrast;
  scene.new_fixed_pattern(1.5F);
  Config config;
  config.front_end.bilateral = c.bilateral;
  config.mapper.optimise = c.optimise;
  auto odometry = ThermalOdometry::create(scene.camera, config);
  Figures figures;
  std::vector<Pose> estimates;
  std::vector<Pose> truths;
  const Pose first = TestScene::drive(0.0, c.speed);
  double path = 0.0;
  double at_start = 0.0;
  double outage_path = 0.0;
  for (int i = 0; i < c.frames; ++i) {
    const Pose pose = TestScene::drive(0.04 * i, c.speed);
    const std::int64_t stamp = i * 40'000'000LL;
    const bool scan = i % 3 == 0 && (i < c.outage_from || i >= c.outage_to);
    DepthPoints cloud;
    if (scan) {
      cloud = scene.scan(TestScene::drive(0.04 * i - c.time_offset_s, c.speed), stamp);
      cloud.T_camera_sensor.linear() =
          so3_exp(Eigen::Vector3d(0, c.yaw_error_deg * M_PI / 180.0, 0)) * cloud.T_camera_sensor.linear();
    }
    const Estimate& estimate = (*odometry)->process(scene.render(pose, stamp), nullptr, scan ? &cloud : nullptr);
    figures.measured += estimate.measured ? 1 : 0;
    estimates.push_back(estimate.T_odom_camera);
    truths.push_back(first.inverse() * pose);
    if (i > 0) path += (truths[truths.size() - 1].translation() - truths[truths.size() - 2].translation()).norm();
    const double error = (estimates.back().translation() - truths.back().translation()).norm();
    if (i == c.outage_from) {
      at_start = error;
      outage_path = path;
    }
    if (i == c.outage_to - 1) figures.outage_percent = 100.0 * std::abs(error - at_start) / (path - outage_path);
  }
  figures.keyframes = static_cast<int>((*odometry)->estimate().counters.keyframes);
  figures.drift_percent = 100.0 * (estimates.back().translation() - truths.back().translation()).norm() / path;
  figures.rotation_deg_per_100m =
      so3_log(estimates.back().rotation().transpose() * truths.back().rotation()).norm() * 180.0 / M_PI / path * 100.0;
  double bias = 0.0;
  double squares = 0.0;
  int n = 0;
  for (std::size_t i = 10; i < estimates.size(); i += 5) {
    const double estimated = (estimates[i].translation() - estimates[i - 5].translation()).norm() / 0.2;
    const double exact = (truths[i].translation() - truths[i - 5].translation()).norm() / 0.2;
    bias += estimated / exact - 1.0;
    squares += (estimated - exact) * (estimated - exact);
    ++n;
  }
  figures.speed_bias_percent = 100.0 * bias / n;
  figures.speed_rms = std::sqrt(squares / n);
  return figures;
}

Figures show(const char* name, const Case& c, std::uint32_t seed = 1) {
  const Figures f = run(c, seed);
  std::printf(
      "%-34s drift %.3f %%  rot %.2f deg/100m  speed bias %+.3f %% rms %.4f m/s  outage %.2f %%  measured %d/%d  kf "
      "%d\n",
      name, f.drift_percent, f.rotation_deg_per_100m, f.speed_bias_percent, f.speed_rms, f.outage_percent, f.measured,
      c.frames, f.keyframes);
  return f;
}

TEST(Study, AnchoredDrift) {
  double worst = 0.0;
  for (std::uint32_t seed = 1; seed <= 5; ++seed)
    worst = std::max(worst, show("anchored 5 m/s", {}, seed).drift_percent);
  EXPECT_LE(worst, 0.3);
  const Figures fast = show("anchored 10 m/s, contrast x0.3", {.speed = 10.0, .contrast = 0.3});
  EXPECT_LE(fast.drift_percent, 0.3);
  EXPECT_LE(fast.speed_rms, 0.1);
  show("frame to keyframe alone", {.optimise = false});
  show("no bilateral", {.bilateral = false});
}

TEST(Study, BoresightAndTimeOffset) {
  const Figures yaw = show("LiDAR yaw wrong by 0.3 deg", {.yaw_error_deg = 0.3});
  show("same, frame to keyframe alone", {.yaw_error_deg = 0.3, .optimise = false});
  const Figures late = show("LiDAR stamps wrong by 10 ms", {.time_offset_s = 0.01});
  EXPECT_LE(yaw.drift_percent, 0.3);
  EXPECT_LE(late.drift_percent, 0.3);
}

TEST(Study, Outage) {
  const Figures f = show("no LiDAR for 50 m", {.frames = 340, .outage_from = 50, .outage_to = 300});
  EXPECT_LE(f.outage_percent, 3.0);
  EXPECT_EQ(f.measured, 339);
}

TEST(Study, TenThousandFuzzedFrames) {
  survive_fuzzed_frames(10'000, 12);
}

}  // namespace
}  // namespace adit::thermal_odometry
