// Figures on recorded sweeps of the shared data folder. Skipped where it is absent.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "components/lidar_odometry/lidar_odometry.hpp"
#include "components/lidar_odometry/test_data.hpp"

namespace adit::lidar_odometry {
namespace {

constexpr double degrees = 57.29577951308232;

std::vector<Pose> poses_of(const std::string& path) {
  std::vector<Pose> poses;
  const Result<Trajectory> trajectory = read_tum(path);
  EXPECT_TRUE(trajectory) << path;
  if (trajectory) {
    for (const StampedPose& p : *trajectory) poses.push_back(p.pose);
  }
  return poses;
}

Config config_of(Mode mode) {
  Config config;
  config.mode = mode;
  return config;
}

// A walking robot with a 16-ring LiDAR, one sweep in 5 s, up to 110 degrees between them; its own odometry, which ends
// 1.11 m and 5.9 degrees off, as prior.
TrajectoryError subt_with_prior(Mode mode, const std::string& folder) {
  const std::vector<Pose> stored = poses_of(folder + "/maplab_lidar.tum");
  LidarOdometry odometry(config_of(mode));
  std::vector<Pose> estimate;
  for (const RecordedSweep& sweep : read_sweeps(folder)) {
    Prior prior;
    const std::size_t k = estimate.size();
    if (k > 0) prior.pose = stored[k - 1].inverse() * stored[k];
    const Estimate& e = odometry.process(sweep.cloud(), &prior);
    EXPECT_TRUE(k == 0 ? e.status == Status::initialising : registered(e.status)) << k;
    estimate.push_back(e.pose);
  }
  return trajectory_error(poses_of(folder + "/ref_lidar.tum"), estimate);
}

// Measured: kiss 0.08 m, 1.0 degrees; genz 0.07 m, 0.5 degrees; default 0.03 m, 0.4 degrees at the end.
TEST(RealData, RepairsTheOdometryOfSubt) {
  const auto folder = shared_data("subt_anymal_vlp16");
  if (!folder) GTEST_SKIP() << "skipped: no shared data";
  const TrajectoryError kiss = subt_with_prior(Mode::kiss, *folder);
  EXPECT_LT(kiss.end, 0.15);
  EXPECT_LT(kiss.end_degrees, 2.0);
  EXPECT_LT(kiss.ate, 0.08);
  const TrajectoryError accurate = subt_with_prior(Mode::default_, *folder);
  EXPECT_LT(accurate.end, 0.05);
  EXPECT_LT(accurate.end_degrees, 0.5);
  EXPECT_LT(accurate.ate, 0.05);
}

// Net drift a sweep [m, degrees] of a sensor at rest.
std::pair<double, double> drift_at_rest(const std::string& folder, std::int64_t stamp_unit_ns) {
  LidarOdometry odometry(config_of(Mode::default_));
  int count = 0;
  for (const RecordedSweep& sweep : read_sweeps(folder, stamp_unit_ns)) {
    const Estimate& e = odometry.process(sweep.cloud());
    EXPECT_EQ(e.status, count == 0 ? Status::initialising : Status::ok) << count;
    ++count;
  }
  const Pose& last = odometry.estimate().pose;
  return {last.translation().norm() / (count - 1), degrees * so3_log(last.linear()).norm() / (count - 1)};
}

TEST(RealData, StandsStillOnASixtyFourRingLidar) {
  const auto folder = shared_data("opencalib_static_64");
  if (!folder) GTEST_SKIP() << "skipped: no shared data";
  const auto [metres, angle] = drift_at_rest(*folder, 1);
  EXPECT_LT(metres, 0.001);
  EXPECT_LT(angle, 0.01);
}

TEST(RealData, StandsStillOnASixteenRingLidar) {
  const auto folder = shared_data("vlp16_static");
  if (!folder) GTEST_SKIP() << "skipped: no shared data";
  const auto [metres, angle] = drift_at_rest(*folder, 1000);
  EXPECT_LT(metres, 0.001);
  EXPECT_LT(angle, 0.02);
}

// Two sweeps 0.5 m and 0.7 degrees apart, without prior: the second sweep finds the unknown velocity. All methods with
// planes agree on a rotation 0.3 degrees from the published pose, so 0.2 degrees is not asked here.
TEST(RealData, FindsAPairWithoutPrior) {
  const auto folder = shared_data("small_gicp_pair");
  if (!folder) GTEST_SKIP() << "skipped: no shared data";
  std::ifstream file(*folder + "/T_target_source.txt");
  Pose truth = Pose::Identity();
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) file >> truth.matrix()(r, c);
  }
  RecordedSweep target, source;
  target.points = read_ply(*folder + "/target.ply");
  source.points = read_ply(*folder + "/source.ply");
  source.stamp_ns = 100'000'000;
  LidarOdometry odometry(config_of(Mode::default_));
  odometry.process(target.cloud());
  const Vector6d error = se3_log(truth.inverse() * odometry.process(source.cloud()).pose);
  EXPECT_LT(error.head<3>().norm(), 0.02);
  EXPECT_LT(degrees * error.tail<3>().norm(), 0.4);
}

// Rooms that repeat every six metres, scans metres apart, no prior: a wrong room must not pass as a good match.
TEST(RealData, DoesNotTrustAFalseMatch) {
  const auto folder = shared_data("indoor_stop_and_go");
  if (!folder) GTEST_SKIP() << "skipped: no shared data";
  const std::vector<RecordedSweep> sweeps = read_sweeps(*folder, 0);
  std::ifstream file(*folder + "/pairs.txt");
  int pairs = 0;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    std::size_t i = 0, j = 0;
    Pose truth = Pose::Identity();
    fields >> i >> j;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 4; ++c) fields >> truth.matrix()(r, c);
    }
    ++pairs;
    for (const bool with_prior : {true, false}) {
      RecordedSweep first = sweeps[i];
      RecordedSweep second = sweeps[j];
      first.stamp_ns = 0;
      second.stamp_ns = 5'000'000'000;
      Prior prior;
      Vector6d offset;
      offset << 0.15, -0.1, 0.05, 0.01, -0.01, 0.03;
      prior.pose = truth * se3_exp(offset);
      LidarOdometry odometry(config_of(Mode::default_));
      odometry.process(first.cloud());
      const Estimate& e = odometry.process(second.cloud(), with_prior ? &prior : nullptr);
      const double error = (truth.translation() - e.pose.translation()).norm();
      if (with_prior) {
        EXPECT_TRUE(registered(e.status)) << i << ' ' << j;
        EXPECT_LT(error, 0.05) << i << ' ' << j << ' ' << to_string(e.status);
      } else {
        EXPECT_TRUE(error < 0.1 || e.status != Status::ok) << i << ' ' << j << " off by " << error;
      }
    }
  }
  EXPECT_EQ(pairs, 3);
}

}  // namespace
}  // namespace adit::lidar_odometry
