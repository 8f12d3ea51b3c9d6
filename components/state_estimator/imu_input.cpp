#include "components/state_estimator/imu_input.hpp"

#include <algorithm>
#include <cmath>

#include "components/geometry/se3.hpp"
#include "components/state_estimator/odometry_track.hpp"

namespace adit::state_estimator {

void Tilt::update(std::int64_t stamp_ns, const Eigen::Vector3d& gyro, const Eigen::Vector3d& force,
                  double forward_accel, double centripetal) {
  const Eigen::Vector3d gravity = force - Eigen::Vector3d(forward_accel, centripetal, 0.0);
  const double size = gravity.norm();
  const bool usable = size > 1e-3 && std::abs(size / config_.gravity - 1.0) < config_.accept_gravity;
  const double dt = stamp_ns_ == kNoStamp ? -1.0 : seconds_between(stamp_ns_, stamp_ns);
  if (stamp_ns_ != kNoStamp && dt <= 0.0) return;
  if (dt < 0.0 || dt > 1.0) {
    if (!usable) return;
    up_ = gravity / size;
  } else {
    // The vertical is fixed in the world: it turns backwards in the body.
    up_ = so3_exp(-gyro * dt) * up_;
    if (usable) up_ += (dt / (config_.time_constant_s + dt)) * (gravity / size - up_);
    up_.normalize();
  }
  stamp_ns_ = stamp_ns;
}

Eigen::Matrix3d Tilt::level() const {
  // Levelled x: the body x axis without its vertical part.
  const Eigen::Vector3d ahead = Eigen::Vector3d::UnitX() - up_.x() * up_;
  if (ahead.norm() < 1e-3) return Eigen::Matrix3d::Identity();  // nose straight up: no heading to keep
  Eigen::Matrix3d rows;
  rows.row(0) = ahead.normalized().transpose();
  rows.row(2) = up_.transpose();
  rows.row(1) = up_.cross(ahead.normalized()).transpose();
  return rows;
}

void OdomTilt::observe(double heading, const Eigen::Matrix3d& in_odom, const Eigen::Matrix3d& by_gravity) {
  constexpr int most = 50;
  observed_ = std::min(observed_ + 1, most);
  const Eigen::Matrix3d turn = so3_exp({0.0, 0.0, heading});
  const Eigen::Matrix3d seen = turn * in_odom * by_gravity.transpose() * turn.transpose();
  const Eigen::Vector3d apart = so3_log(odom_from_gravity_.transpose() * seen);
  odom_from_gravity_ = odom_from_gravity_ * so3_exp(apart / observed_);
}

Eigen::Matrix3d OdomTilt::in_odom(double heading, const Eigen::Matrix3d& by_gravity) const {
  return level_of(odom_from_gravity_ * so3_exp({0.0, 0.0, heading}) * by_gravity);
}

void StandstillDetector::update(std::int64_t stamp_ns, const Eigen::Vector3d& gyro, const Eigen::Vector3d& force) {
  const double dt = stamp_ns_ == kNoStamp ? 1e9 : seconds_between(stamp_ns_, stamp_ns);
  if (dt <= 0.0) return;
  stamp_ns_ = stamp_ns;
  if (dt > 0.5) {  // start or gap
    gyro_mean_ = gyro;
    force_mean_ = force;
    gyro_variance_ = force_variance_ = 1.0;
    quiet_since_ns_ = kNoStamp;
    stands_ = false;
    return;
  }
  const double gain = dt / (config_.window_s + dt);
  gyro_variance_ += gain * ((gyro - gyro_mean_).squaredNorm() / 3.0 - gyro_variance_);
  force_variance_ += gain * ((force - force_mean_).squaredNorm() / 3.0 - force_variance_);
  gyro_mean_ += gain * (gyro - gyro_mean_);
  force_mean_ += gain * (force - force_mean_);
  const bool quiet = gyro_variance_ < config_.gyro_sigma * config_.gyro_sigma &&
                     force_variance_ < config_.force_sigma * config_.force_sigma &&
                     gyro_mean_.norm() < config_.gyro_mean;
  if (!quiet) quiet_since_ns_ = kNoStamp;
  if (quiet && quiet_since_ns_ == kNoStamp) quiet_since_ns_ = stamp_ns;
  stands_ = quiet && seconds_between(quiet_since_ns_, stamp_ns) >= config_.hold_s;
}

}  // namespace adit::state_estimator
