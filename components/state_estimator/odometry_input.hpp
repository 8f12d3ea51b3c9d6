// From what an odometry reports (a relative pose of its sensor) to what the filter takes: (v, psi') at the interval's
// midpoint, or (dx, dy, dpsi) between two instants, with noise per direction.
#pragma once

#include <cstdint>
#include <optional>

#include "components/geometry/se3.hpp"
#include "components/state_estimator/measurement.hpp"
#include "components/state_estimator/measurement_models.hpp"

namespace adit::state_estimator {

// Motion of the sensor frame between two instants: `motion` is the pose at `to` in the frame at `from`.
struct RelativeMotion {
  std::int64_t from_ns = kNoStamp;
  std::int64_t to_ns = kNoStamp;
  Pose motion = Pose::Identity();
  // Information of `motion`'s right perturbation [rho; theta] (sensor axes at `to`), the likelihood alone, without any
  // prior; singular where the scene does not constrain. Nothing: the configured deviations hold.
  std::optional<Matrix6d> information;
  // Rotates body axes at `from` to levelled axes of the same heading; identity when roll and pitch are unknown.
  Eigen::Matrix3d level = Eigen::Matrix3d::Identity();
  double suspicion = 0.0;  // the front end's own doubt, 0 to 1 (smoke, saturation, few features)
  std::optional<double> log_scale_sigma;
};

struct OdometryConfig {
  Pose body_from_sensor = Pose::Identity();  // extrinsic calibration T_BS
  bool relative_pose = true;                 // false: the paper's (v, psi') pseudo-measurements
  bool fixed_noise = false;                  // ignore reported information (the paper)
  OdometryCalibration calibration;
  // Deviations of (v, psi'), and of one relative pose, when nothing is reported.
  double sigma_speed = 0.05, speed_fraction = 0.0;         // m/s, of v
  double sigma_yaw_rate = 0.0015;                          // rad/s
  double sigma_position = 0.01, position_fraction = 0.01;  // m, of the distance
  double sigma_yaw = 0.001, yaw_fraction = 0.0;            // rad, of the turn
  // Never trusted better than this, whatever is reported.
  double floor_position = 0.001, floor_yaw = 5e-5;  // m, rad
  // A direction known no better than this carries no information.
  double max_sigma_position = 1.0, max_sigma_yaw = 0.2;  // m, rad
  double stamp_jitter_s = 0.0;                           // of the difference of the two stamps
  double max_interval_s = 0.5;                           // longer intervals are gaps
  double max_speed = 60.0, max_yaw_rate = 6.0;           // beyond: not a motion but a jump
  // Relative poses keep their anchor this long while nothing speaks against the sensor, so that errors of scan-to-map
  // poses telescope; 0: consecutive poses.
  double anchor_period_s = 0.0;
};

enum class Conversion { ok, not_finite, bad_interval, implausible };

// Errors: not_finite (also a rotation that is none), bad_interval (not positive, or a gap), implausible.
Conversion to_measurement(const RelativeMotion& input, const OdometryConfig& config, std::uint8_t sensor,
                          Measurement& out);

// Inverse of a covariance as information. NaN, infinite or negative variances: nothing. Zero matrix (ROS: unknown):
// nothing. Deviations beyond 1e6 carry no information; eigenvalues are floored so that the result is finite.
std::optional<Matrix6d> information_from_covariance(const Matrix6d& covariance);

}  // namespace adit::state_estimator
