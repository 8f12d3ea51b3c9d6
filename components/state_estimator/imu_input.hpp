// What the planar filter needs from an inertial unit: levelled yaw rate and forward acceleration, and whether it
// stands.
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "components/state_estimator/state.hpp"

namespace adit::state_estimator {

// Roll and pitch from angular rate, drawn slowly to the direction of gravity: a complementary filter on SO(3) (Mahony,
// Hamel, Pflimlin, "Nonlinear complementary filters on the special orthogonal group", 2008, eq. (32), without bias).
class Tilt {
 public:
  struct Config {
    double time_constant_s = 3.0;
    double gravity = 9.81;         // m/s^2
    double accept_gravity = 0.15;  // share by which the specific force may differ from gravity to be used
  };
  Tilt() = default;
  explicit Tilt(const Config& config) : config_(config) {}

  // Body axes: angular rate [rad/s], specific force [m/s^2] (about +9.81 on z when level), of a body moving with
  // `forward_accel` and `centripetal` [m/s^2] along x and y, which are not gravity. Stamps that do not increase are
  // ignored; a gap above 1 s starts anew from the specific force.
  void update(std::int64_t stamp_ns, const Eigen::Vector3d& gyro, const Eigen::Vector3d& force, double forward_accel,
              double centripetal);
  bool ready() const { return stamp_ns_ != kNoStamp; }
  // Body axes to levelled axes of the same heading.
  Eigen::Matrix3d level() const;

 private:
  Config config_;
  std::int64_t stamp_ns_ = kNoStamp;
  Eigen::Vector3d up_ = Eigen::Vector3d::UnitZ();  // the vertical in body axes
};

// How odom, which is level as the body was at its start, lies to gravity: makes the IMU's roll and pitch those in odom,
// so that they go on where an odometry's stop.
class OdomTilt {
 public:
  // The body's axes to axes of its `heading` [rad] that are level in odom, and to those that are level by gravity, at
  // one instant: averaged over the last 50.
  void observe(double heading, const Eigen::Matrix3d& in_odom, const Eigen::Matrix3d& by_gravity);
  bool ready() const { return observed_ > 0; }
  Eigen::Matrix3d in_odom(double heading, const Eigen::Matrix3d& by_gravity) const;

 private:
  Eigen::Matrix3d odom_from_gravity_ = Eigen::Matrix3d::Identity();
  int observed_ = 0;
};

// Stands still when angular rate and specific force stay constant for a while.
class StandstillDetector {
 public:
  struct Config {
    double window_s = 0.4;
    double gyro_sigma = 0.01;   // rad/s, per axis
    double force_sigma = 0.12;  // m/s^2, per axis
    double gyro_mean = 0.05;    // rad/s: a constant turn is not standing still
    double hold_s = 0.4;        // quiet this long
  };
  StandstillDetector() = default;
  explicit StandstillDetector(const Config& config) : config_(config) {}

  void update(std::int64_t stamp_ns, const Eigen::Vector3d& gyro, const Eigen::Vector3d& force);
  bool stands() const { return stands_; }
  // Scatter of the specific force about its recent mean, variance of one axis [(m/s^2)^2]: vibration, steps.
  double force_variance() const { return force_variance_; }

 private:
  Config config_;
  std::int64_t stamp_ns_ = kNoStamp, quiet_since_ns_ = kNoStamp;
  Eigen::Vector3d gyro_mean_ = Eigen::Vector3d::Zero(), force_mean_ = Eigen::Vector3d::Zero();
  double gyro_variance_ = 1.0, force_variance_ = 1.0;
  bool stands_ = false;
};

}  // namespace adit::state_estimator
