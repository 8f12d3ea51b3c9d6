#include "components/state_estimator/measurement_models.hpp"

#include <algorithm>
#include <cmath>

namespace adit::state_estimator {
namespace {

// Whether the motion is known from elsewhere: a sensor's delay cannot be told from its own account of it.
bool others_see_motion(const FilterState& state, const Measurement& m) {
  constexpr double fresh = 0.5;  // s
  for (std::size_t i = 0; i < state.sensors.size(); ++i) {
    const SensorState& other = state.sensors[i];
    if (i != m.sensor && other.window.stamp_ns != kNoStamp && other.last_accepted_ns != kNoStamp &&
        seconds_between(other.last_accepted_ns, m.stamp_ns) < fresh) {
      return true;
    }
  }
  return false;
}

// How fast speed or yaw rate change, if that is beyond doubt, and d(that) / d(acceleration state). An odometry's
// noise changes its sign from step to step, and an acceleration estimated from one step is of the other sign than the
// next step's noise: taken for knowledge, the two look like a delay of 0.05 to 0.1 s where there is none.
struct Change {
  double rate = 0.0, slope = 0.0;
  Change(const FilterState& state, int acceleration) {
    const double sigma = std::sqrt(std::max(0.0, state.p(acceleration, acceleration)));
    if (std::abs(state.x(acceleration)) <= 4.0 * sigma) return;
    rate = state.x(acceleration);
    slope = 1.0;
  }
};

}  // namespace

Linearization SpeedAndYawRate::linearize(const FilterState& state, const Measurement& m) const {
  Linearization l;
  const double scale = calibration_.scale ? std::exp(state.x(kScale)) : 1.0;
  const double bias = calibration_.yaw_bias ? state.x(kThermalYawBias) : 0.0;
  double speed = state.x(kSpeed), yaw_rate = state.x(kYawRate);
  if (calibration_.delay) {
    const double delay = state.x(kThermalDelay);
    const Change along(state, kAccel), turn(state, kYawAccel);
    speed -= delay * along.rate;
    yaw_rate -= delay * turn.rate;
    l.jacobian(0, kAccel) = -scale * delay * along.slope;
    l.jacobian(1, kYawAccel) = -delay * turn.slope;
    if (others_see_motion(state, m)) {
      l.jacobian(0, kThermalDelay) = -scale * along.rate;
      l.jacobian(1, kThermalDelay) = -turn.rate;
    }
  }
  l.innovation(0) = m.value(0) - scale * speed;
  l.innovation(1) = m.value(1) - yaw_rate - bias;
  l.jacobian(0, kSpeed) = scale;
  l.jacobian(1, kYawRate) = 1.0;
  if (calibration_.scale) l.jacobian(0, kScale) = scale * speed;
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
  Eigen::Vector2d moved = to_anchor * (state.x.segment<2>(kX) - state.x.segment<2>(anchor));
  double turned = state.x(kYaw) - state.x(anchor + 2);
  Linearization l;
  if (calibration_.delay) {  // the same span, begun that much earlier
    const double delay = state.x(kThermalDelay);
    const Change along(state, kAccel), turn(state, kYawAccel);
    const Eigen::Vector2d ahead(std::cos(turned), std::sin(turned));
    const double earlier = delay * span * along.rate;
    moved -= earlier * ahead;
    turned -= delay * span * turn.rate;
    l.jacobian.block<2, 1>(0, kYaw) = scale * earlier * Eigen::Vector2d(ahead.y(), -ahead.x());
    l.jacobian.block<2, 1>(0, kAccel) = -scale * delay * span * along.slope * ahead;
    l.jacobian(2, kYawAccel) = -delay * span * turn.slope;
    if (others_see_motion(state, m)) {
      l.jacobian.block<2, 1>(0, kThermalDelay) = -scale * span * along.rate * ahead;
      l.jacobian(2, kThermalDelay) = -span * turn.rate;
    }
  }
  l.innovation.head<2>() = m.value.head<2>() - scale * moved;
  l.innovation(2) = wrap_angle(m.value(2) - turned - bias * span);
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
