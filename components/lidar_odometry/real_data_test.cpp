// Figures on recorded sweeps of the shared data folder. Skipped where it is absent.
#include <gtest/gtest.h>

#include "components/lidar_odometry/lidar_odometry.hpp"
#include "components/lidar_odometry/test_data.hpp"

namespace adit::lidar_odometry {
namespace {

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

// A walking robot with a 16-ring LiDAR, one sweep in 5 s, up to 110 degrees between them; its own odometry as prior.
TrajectoryError subt_with_prior(const Config& config, const std::string& folder) {
  const std::vector<Pose> stored = poses_of(folder + "/maplab_lidar.tum");
  LidarOdometry odometry(config);
  std::vector<Pose> estimate;
  for (const RecordedSweep& sweep : read_sweeps(folder)) {
    Prior prior;
    const std::size_t k = estimate.size();
    if (k > 0) prior.pose = stored[k - 1].inverse() * stored[k];
    const Estimate& e = odometry.process(sweep.cloud(), &prior);
    EXPECT_EQ(e.status, k == 0 ? Status::initialising : Status::ok) << k;
    estimate.push_back(e.pose);
  }
  return trajectory_error(poses_of(folder + "/ref_lidar.tum"), estimate);
}

TEST(RealData, KissRepairsTheOdometryOfSubt) {
  const auto folder = shared_data("subt_anymal_vlp16");
  if (!folder) GTEST_SKIP() << "skipped: no shared data";
  const TrajectoryError error = subt_with_prior(config_of(Mode::kiss), *folder);
  RecordProperty("end_m", std::to_string(error.end));
  RecordProperty("end_deg", std::to_string(error.end_degrees));
  // The stored odometry ends 1.11 m and 5.9 degrees off; measured here: 0.08 m, 1.0 degrees, ATE 0.055 m.
  EXPECT_LT(error.end, 0.15);
  EXPECT_LT(error.end_degrees, 2.0);
  EXPECT_LT(error.ate, 0.08);
}

}  // namespace
}  // namespace adit::lidar_odometry
