// Recorded and rendered sequences: the bars of the published method and of real 16-bit cameras.
#include <gtest/gtest.h>

#include <ctime>
#include <iostream>

#include "components/thermal_odometry/test_data.hpp"
#include "components/thermal_odometry/thermal_odometry.hpp"

namespace adit::thermal_odometry {
namespace {

double cpu_ms() {
  return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

// 110 frames of a curved tunnel, 640 x 512, 25 Hz, 10.3 m; the published LDSO on the same frames: initialised at frame
// 9, Sim(3) ATE 0.014 m, 0.47 % per 5 m, 0.44 degrees per 100 m, 100 ms a frame.
TEST(SyntheticTunnel, MonocularMatchesThePublishedMethod) {
  const auto folder = shared_data("synthetic_thermal");
  if (folder.empty()) GTEST_SKIP() << "skipped: no shared data";
  const auto truth = read_tum((folder / "gt.tum").string());
  ASSERT_TRUE(truth);
  Config config;
  config.mode = Mode::mono;
  auto created = ThermalOdometry::create({640, 512, 417.032, 417.032, 319.5, 255.5, Distortion::none, {}}, config);
  ASSERT_TRUE(created);
  ThermalOdometry& odometry = **created;
  std::vector<Pose> estimates;
  std::vector<Pose> truths;
  int initialised = -1;
  double spent = 0.0;
  const bool verbose = std::getenv("ADIT_VERBOSE") != nullptr;
  for (int i = 0; i < 110; ++i) {
    const Recorded image = read_frame(folder, i);
    ASSERT_FALSE(image.pixels.empty());
    const double before = cpu_ms();
    const Estimate& estimate = odometry.process(image.at(i * 40'000'000LL));
    const double took = cpu_ms() - before;
    spent += took;
    if (verbose) {
      std::cout << i << " status " << static_cast<int>(estimate.status) << " kf " << estimate.new_keyframe << " sel "
                << estimate.selected << " pts " << estimate.points << " res " << estimate.residual << " in "
                << estimate.inlier_share << " vis " << estimate.visible_share << " corr " << estimate.correlation
                << " a " << estimate.gain << " ms " << took << " pos "
                << estimate.T_odom_camera.translation().transpose() << "\n";
    }
    if (estimate.status != Status::tracking) continue;
    if (initialised < 0) initialised = i;
    estimates.push_back(estimate.T_odom_camera);
    truths.push_back((*truth)[static_cast<std::size_t>(i)].pose);
  }
  ASSERT_GE(initialised, 0);
  EXPECT_LE(initialised, 15);
  EXPECT_EQ(static_cast<int>(estimates.size()), 110 - initialised);
  const Alignment sim = align(estimates, truths, true);
  double rotation = 0.0;
  const double relative = relative_error(estimates, truths, 5.0, sim.scale, &rotation);
  std::cout << "initialised at frame " << initialised << ", Sim(3) ATE " << sim.rmse << " m, relative "
            << 100 * relative << " % per 5 m, rotation " << rotation << " deg/100 m, keyframes "
            << odometry.estimate().counters.keyframes << ", " << spent / 110 << " ms CPU a frame\n";
  EXPECT_LE(sim.rmse, 0.014);
  EXPECT_LE(relative, 0.005);
  EXPECT_LE(spent / 110, 25.0);
}

}  // namespace
}  // namespace adit::thermal_odometry
