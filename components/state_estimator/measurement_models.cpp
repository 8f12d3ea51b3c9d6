#include "components/state_estimator/measurement_models.hpp"

#include <cmath>

namespace adit::state_estimator {

Linearization SpeedAndYawRate::linearize(const FilterState& state, const Measurement& m) const {
  Linearization l;
  const double scale = calibration_.scale ? std::exp(state.x(kScale)) : 1.0;
  const double bias = calibration_.yaw_bias ? state.x(kThermalYawBias) : 0.0;
  l.innovation(0) = m.value(0) - scale * state.x(kSpeed);
  l.innovation(1) = m.value(1) - state.x(kYawRate) - bias;
  l.jacobian(0, kSpeed) = scale;
  l.jacobian(1, kYawRate) = 1.0;
  if (calibration_.scale) l.jacobian(0, kScale) = scale * state.x(kSpeed);
  if (calibration_.yaw_bias) l.jacobian(1, kThermalYawBias) = 1.0;
  return l;
}

Linearization PlanarRelativePose::linearize(const FilterState& state, const Measurement& m) const {
  const int anchor = clone_index(slot_);
  const double scale = calibration_.scale ? std::exp(state.x(kScale)) : 1.0;
  const double span = seconds_between(m.anchor_ns, m.stamp_ns);
  const double bias = calibration_.yaw_bias ? state.x(kThermalYawBias) : 0.0;
  const double c = std::cos(state.x(anchor + 2)), s = std::sin(state.x(anchor + 2));
  Eigen::Matrix2d to_anchor;
  to_anchor << c, s, -s, c;
  const Eigen::Vector2d moved = to_anchor * (state.x.segment<2>(kX) - state.x.segment<2>(anchor));
  Linearization l;
  l.innovation.head<2>() = m.value.head<2>() - scale * moved;
  l.innovation(2) = wrap_angle(m.value(2) - (state.x(kYaw) - state.x(anchor + 2)) - bias * span);
  l.jacobian.block<2, 2>(0, kX) = scale * to_anchor;
  l.jacobian.block<2, 2>(0, anchor) = -scale * to_anchor;
  l.jacobian(0, anchor + 2) = scale * moved.y();
  l.jacobian(1, anchor + 2) = -scale * moved.x();
  l.jacobian(2, kYaw) = 1.0;
  l.jacobian(2, anchor + 2) = -1.0;
  if (calibration_.scale) l.jacobian.block<2, 1>(0, kScale) = scale * moved;
  if (calibration_.yaw_bias) l.jacobian(2, kThermalYawBias) = span;
  return l;
}

Linearization GyroYawRate::linearize(const FilterState& state, const Measurement& m) const {
  Linearization l;
  l.innovation(0) = m.value(0) - state.x(kYawRate) - state.x(kGyroBias);
  l.jacobian(0, kYawRate) = 1.0;
  l.jacobian(0, kGyroBias) = 1.0;
  return l;
}

Linearization ImuYawRateAndAcceleration::linearize(const FilterState& state, const Measurement& m) const {
  const double w = state.x(kYawRate);
  Linearization l;
  l.innovation(0) = m.value(0) - w - state.x(kGyroBias);
  l.innovation(1) = m.value(1) - (state.x(kAccel) + state.x(kAccelBias) - state.x(kYawAccel) * lever_arm_.y() -
                                  w * w * lever_arm_.x());
  l.jacobian(0, kYawRate) = 1.0;
  l.jacobian(0, kGyroBias) = 1.0;
  l.jacobian(1, kAccel) = 1.0;
  l.jacobian(1, kAccelBias) = 1.0;
  l.jacobian(1, kYawAccel) = -lever_arm_.y();
  l.jacobian(1, kYawRate) = -2.0 * w * lever_arm_.x();
  return l;
}

Linearization GnssPosition::linearize(const FilterState& state, const Measurement& m) const {
  const double c = std::cos(state.x(kYaw)), s = std::sin(state.x(kYaw));
  const Eigen::Vector2d arm(c * lever_arm_.x() - s * lever_arm_.y(), s * lever_arm_.x() + c * lever_arm_.y());
  Linearization l;
  l.innovation.head<2>() = m.value.head<2>() - state.x.segment<2>(kX) - arm;
  l.jacobian(0, kX) = 1.0;
  l.jacobian(1, kY) = 1.0;
  l.jacobian(0, kYaw) = -arm.y();
  l.jacobian(1, kYaw) = arm.x();
  return l;
}

Linearization Speed::linearize(const FilterState& state, const Measurement& m) const {
  Linearization l;
  l.innovation(0) = m.value(0) - state.x(kSpeed);
  l.jacobian(0, kSpeed) = 1.0;
  return l;
}

Linearization ZeroVelocity::linearize(const FilterState& state, const Measurement&) const {
  Linearization l;
  l.innovation.head<2>() << -state.x(kSpeed), -state.x(kYawRate);
  l.jacobian(0, kSpeed) = 1.0;
  l.jacobian(1, kYawRate) = 1.0;
  return l;
}

}  // namespace adit::state_estimator
