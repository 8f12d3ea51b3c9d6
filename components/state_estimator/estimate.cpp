#include "components/state_estimator/estimate.hpp"

#include <algorithm>
#include <cmath>

namespace adit::state_estimator {

Estimate to_estimate(const FilterState& state, double height, const Eigen::Matrix3d& level) {
  Estimate e;
  e.stamp_ns = state.stamp_ns;
  e.pose.linear() = so3_exp({0.0, 0.0, state.x(kYaw)}) * level;
  e.pose.translation() = Eigen::Vector3d(state.x(kX), state.x(kY), height);
  e.speed = state.x(kSpeed);
  e.accel = state.x(kAccel);
  e.yaw_rate = state.x(kYawRate);
  e.yaw_accel = state.x(kYawAccel);
  constexpr int pose[3] = {kX, kY, kYaw};
  constexpr int twist[2] = {kSpeed, kYawRate};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) e.pose_covariance(i, j) = state.p(pose[i], pose[j]);
  }
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) e.twist_covariance(i, j) = state.p(twist[i], twist[j]);
  }
  return e;
}

void OutputSmoother::apply(Estimate& e) {
  const Estimate raw = e;
  if (config_.smoothing_s > 0.0 && last_) {
    const double dt = seconds_between(last_->stamp_ns, e.stamp_ns);
    const PlanarPose before(last_->pose.translation().x(), last_->pose.translation().y(), yaw(last_->pose.linear()));
    const double turn = last_->yaw_rate * dt;
    const PlanarPose expected =
        compose(before, {last_->speed * dt * std::cos(0.5 * turn), last_->speed * dt * std::sin(0.5 * turn), turn});
    const PlanarPose now(e.pose.translation().x(), e.pose.translation().y(), yaw(e.pose.linear()));
    PlanarPose jump = now - expected;
    jump.z() = wrap_angle(jump.z());
    not_yet_shown_ *= std::exp(-dt / config_.smoothing_s);
    // Seldom outputs (several hundred ms apart) move on by themselves: what they do in between is no jump.
    const double distance = jump.head<2>().norm();
    const bool often = dt < 0.3;
    if (often && distance > config_.largest_jump_m) {
      not_yet_shown_.head<2>() -= jump.head<2>() * (1.0 - config_.largest_jump_m / distance);
    }
    if (often && std::abs(jump.z()) > config_.largest_jump_rad) {
      not_yet_shown_.z() -= jump.z() * (1.0 - config_.largest_jump_rad / std::abs(jump.z()));
    }
    e.pose.translation().head<2>() += not_yet_shown_.head<2>();
    e.pose.linear() = so3_exp({0.0, 0.0, not_yet_shown_.z()}) * e.pose.linear();
  } else {
    not_yet_shown_.setZero();
  }
  last_ = raw;
}

}  // namespace adit::state_estimator
