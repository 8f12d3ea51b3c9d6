// map -> odom: where loop closures and other absolute poses go, so that odom itself stays continuous. A small Kalman
// filter on (x, y, psi) of the transform, whose uncertainty grows as the odometry's does.
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "components/state_estimator/state.hpp"

namespace adit::state_estimator {

// (x, y, psi) of frame b in frame a.
using PlanarPose = Eigen::Vector3d;
PlanarPose compose(const PlanarPose& a_b, const PlanarPose& b_c);
PlanarPose inverse(const PlanarPose& a_b);

class MapCorrection {
 public:
  struct Config {
    double gate = 21.1075;         // chi-square, 3 degrees of freedom, 99.99 %
    double position_floor = 0.02;  // m, of a closure
    double yaw_floor = 0.001;      // rad
  };
  MapCorrection() = default;
  explicit MapCorrection(const Config& config) : config_(config) {}

  enum class Outcome { applied, rejected, malformed };
  // An absolute pose of base_link in map with its covariance, and what odom says about the same instant: its pose and
  // how much odom may have drifted since the previous closure (covariance). The first one is believed.
  Outcome add(const PlanarPose& map_body, const Eigen::Matrix3d& covariance, const PlanarPose& odom_body,
              const Eigen::Matrix3d& odom_drift);

  const PlanarPose& map_odom() const { return map_odom_; }
  const Eigen::Matrix3d& covariance() const { return p_; }
  std::uint64_t applied() const { return applied_; }
  std::uint64_t rejected() const { return rejected_; }

 private:
  Config config_;
  PlanarPose map_odom_ = PlanarPose::Zero();
  Eigen::Matrix3d p_ = Eigen::Matrix3d::Zero();
  std::uint64_t applied_ = 0, rejected_ = 0;
};

}  // namespace adit::state_estimator
