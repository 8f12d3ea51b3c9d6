// What goes into the estimator, and what became of it.
#pragma once

#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "components/geometry/se3.hpp"
#include "components/state_estimator/state.hpp"

namespace adit::state_estimator {

// What became of an input. Everything but `fused` and `first` is counted in the sensor's report.
enum class Verdict {
  fused,            // handed to the filter (its gate may still refuse it: see SensorReport)
  first,            // the first pose of an odometry: the next one makes a motion
  too_old,          // before the history
  duplicate,        // this sensor and stamp are known
  from_the_future,  // later than now
  malformed,        // NaN, not a rotation, negative variance, ...
  gap,              // not after the previous pose, or too long after it
  jump,             // a motion beyond all limits: the odometry restarted
  unknown_sensor,
};

struct OdometrySample {
  std::int64_t stamp_ns = kNoStamp;
  Pose pose = Pose::Identity();  // of the sensor frame in the odometry's own frame
  // Information of the motion since the sample before (or of the pose in the local map, with anchor_period_s), right
  // perturbation [rho; theta]; nothing: configured deviations.
  std::optional<Matrix6d> information;
  std::uint64_t frame = 0;  // another value: the odometry's frame is a new one (restart, re-initialization)
  double suspicion = 0.0;   // the front end's own doubt, 0 none to 1 certain
  std::optional<double> log_scale_sigma;  // the front end's own deviation of ln(scale), where it has one
};

struct ImuSample {
  std::int64_t stamp_ns = kNoStamp;
  Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();    // rad/s, sensor axes
  Eigen::Vector3d specific_force = Eigen::Vector3d::Zero();  // m/s^2, sensor axes
};

struct GnssSample {
  std::int64_t stamp_ns = kNoStamp;
  Eigen::Vector2d position = Eigen::Vector2d::Zero();        // m, antenna in odom (local level east-north frame)
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  // m^2
};

}  // namespace adit::state_estimator
