// What the estimator says of an instant, and how it is made fit for publishing.
#pragma once

#include <cstdint>
#include <optional>

#include "components/geometry/se3.hpp"
#include "components/state_estimator/map_correction.hpp"
#include "components/state_estimator/state.hpp"

namespace adit::state_estimator {

struct Estimate {
  std::int64_t stamp_ns = kNoStamp;
  Pose pose = Pose::Identity();  // base_link in odom: planar position and heading by the filter; height, roll and
                                 // pitch carried over from the odometry and the IMU
  double speed = 0.0, accel = 0.0, yaw_rate = 0.0, yaw_accel = 0.0;
  Eigen::Matrix3d pose_covariance = Eigen::Matrix3d::Zero();   // (x, y, yaw) in odom
  Eigen::Matrix2d twist_covariance = Eigen::Matrix2d::Zero();  // (speed, yaw rate)
};

// `level`: the body's rotation without its heading.
Estimate to_estimate(const FilterState& state, double height, const Eigen::Matrix3d& level);

// Takes the part of a correction beyond a permitted jump off the output and gives it back over `smoothing_s`.
class OutputSmoother {
 public:
  struct Config {
    double largest_jump_m = 0.02, largest_jump_rad = 0.005, smoothing_s = 0.4;  // smoothing_s 0: off
  };
  explicit OutputSmoother(const Config& config) : config_(config) {}
  // Outputs in the order of their stamps.
  void apply(Estimate& estimate);
  void restart() { last_ = std::nullopt; }

 private:
  Config config_;
  std::optional<Estimate> last_;                   // before smoothing
  PlanarPose not_yet_shown_ = PlanarPose::Zero();  // output minus estimate
};

}  // namespace adit::state_estimator
