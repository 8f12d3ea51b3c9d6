#include "components/state_estimator/process_model.hpp"

#include <algorithm>
#include <cmath>

#include "components/geometry/se3.hpp"

namespace adit::state_estimator {
namespace {

// Mean over the step of a quantity that decays from 1, and its value at the end.
struct Decay {
  double mean = 1.0, end = 1.0;
  Decay(double step, double tau) {
    if (tau <= 0.0 || step <= 0.0) return;
    end = std::exp(-step / tau);
    mean = -std::expm1(-step / tau) * tau / step;
  }
};

// A longer silence is bridged with longer steps: a wrong clock must cost precision, not minutes of computing.
constexpr int kMaxSteps = 2000;

void step(FilterState& s, double dt, double decay_tau, const ProcessNoise& noise) {
  const CoreVector x = s.x.head<kCoreStates>();
  const CoreMatrix g = transition_jacobian(x, dt, decay_tau);
  const CoreMatrix q = process_noise(x, dt, noise);
  s.x.head<kCoreStates>() = transition(x, dt, decay_tau);
  constexpr int rest = kStates - kCoreStates;
  const CoreMatrix gp = g.lazyProduct(s.p.topLeftCorner<kCoreStates, kCoreStates>());
  CoreMatrix core = gp.lazyProduct(g.transpose()) + q;
  core = 0.5 * (core + core.transpose()).eval();
  s.p.topLeftCorner<kCoreStates, kCoreStates>() = core;
  const Eigen::Matrix<double, kCoreStates, rest> cross = g.lazyProduct(s.p.topRightCorner<kCoreStates, rest>());
  s.p.topRightCorner<kCoreStates, rest>() = cross;
  s.p.bottomLeftCorner<rest, kCoreStates>() = cross.transpose();
  // A calibration state without variance is switched off and stays so.
  const auto walk = [&](int index, double density) {
    if (s.p(index, index) > 0.0) s.p(index, index) += density * dt;
  };
  walk(kScale, noise.scale);
  walk(kThermalYawBias, noise.thermal_yaw_bias);
  walk(kThermalDelay, noise.thermal_delay);
  walk(kGyroBias, noise.gyro_bias);
  walk(kAccelBias, noise.accel_bias);
}

// Scalar measurement "the value is at its limit" with a deviation of a tenth of it, when the estimate is beyond.
void soft_limit(FilterState& s, int index, double limit) {
  if (limit <= 0.0 || std::abs(s.x(index)) <= limit) return;
  const double variance = 0.01 * limit * limit;
  const StateVector b = s.p.col(index);
  const double innovation = std::copysign(limit, s.x(index)) - s.x(index);
  const StateVector k = b / (b(index) + variance);
  s.x += k * innovation;
  s.x(kYaw) = wrap_angle(s.x(kYaw));
  s.p -= k * b.transpose();
  s.p = 0.5 * (s.p + s.p.transpose()).eval();
}

void advance(FilterState& s, std::int64_t to_ns, double decay_tau, const ProcessConfig& config) {
  const double span = seconds_between(s.stamp_ns, to_ns);
  if (span <= 0.0) return;
  const int steps =
      std::clamp(static_cast<int>(std::ceil(std::min(span / config.max_step_s, 1e6) - 1e-9)), 1, kMaxSteps);
  for (int i = 0; i < steps; ++i) {
    step(s, span / steps, decay_tau, config.noise);
    soft_limit(s, kSpeed, config.max_speed);
    soft_limit(s, kAccel, config.max_accel);
    soft_limit(s, kYawRate, config.max_yaw_rate);
    soft_limit(s, kYawAccel, config.max_yaw_accel);
  }
  s.stamp_ns = to_ns;
}

}  // namespace

CoreVector transition(const CoreVector& x, double t, double decay_tau) {
  const Decay decay(t, decay_tau);
  const double c = std::cos(x(kYaw)), s = std::sin(x(kYaw));
  const double v = x(kSpeed), w = x(kYawRate);
  const double a = x(kAccel) * decay.mean, alpha = x(kYawAccel) * decay.mean;
  const double t2 = t * t / 2.0, t3 = t * t * t / 6.0;
  CoreVector next;
  next(kX) = x(kX) + t * v * c + t2 * (a * c - v * w * s) + t3 * (-2 * a * w * s - v * alpha * s - v * w * w * c);
  next(kY) = x(kY) + t * v * s + t2 * (a * s + v * w * c) + t3 * (2 * a * w * c + v * alpha * c - v * w * w * s);
  next(kSpeed) = v + t * a;
  next(kAccel) = x(kAccel) * decay.end;
  next(kYaw) = wrap_angle(x(kYaw) + t * w + t2 * alpha);
  next(kYawRate) = w + t * alpha;
  next(kYawAccel) = x(kYawAccel) * decay.end;
  return next;
}

CoreMatrix transition_jacobian(const CoreVector& x, double t, double decay_tau) {
  const Decay decay(t, decay_tau);
  const double c = std::cos(x(kYaw)), s = std::sin(x(kYaw));
  const double v = x(kSpeed), w = x(kYawRate);
  const double a = x(kAccel) * decay.mean, alpha = x(kYawAccel) * decay.mean;
  const double t2 = t * t / 2.0, t3 = t * t * t / 6.0;
  CoreMatrix g = CoreMatrix::Identity();
  g(kX, kSpeed) = t * c - t2 * w * s - t3 * (alpha * s + w * w * c);
  g(kY, kSpeed) = t * s + t2 * w * c + t3 * (alpha * c - w * w * s);
  g(kX, kAccel) = t2 * c - 2 * t3 * w * s;
  g(kY, kAccel) = t2 * s + 2 * t3 * w * c;
  g(kX, kYaw) = -t * v * s - t2 * (a * s + v * w * c) - t3 * (2 * a * w * c + v * alpha * c - v * w * w * s);
  g(kY, kYaw) = t * v * c + t2 * (a * c - v * w * s) + t3 * (-2 * a * w * s - v * alpha * s - v * w * w * c);
  g(kX, kYawRate) = -t2 * v * s - 2 * t3 * (a * s + v * w * c);
  g(kY, kYawRate) = t2 * v * c + 2 * t3 * (a * c - v * w * s);
  g(kX, kYawAccel) = -t3 * v * s;
  g(kY, kYawAccel) = t3 * v * c;
  g(kSpeed, kAccel) = t;
  g(kYaw, kYawRate) = t;
  g(kYaw, kYawAccel) = t2;
  g(kYawRate, kYawAccel) = t;
  // The map saw the mean accelerations; the state keeps those at the end of the step.
  g.col(kAccel) *= decay.mean;
  g.col(kYawAccel) *= decay.mean;
  g(kAccel, kAccel) = decay.end;
  g(kYawAccel, kYawAccel) = decay.end;
  return g;
}

CoreMatrix process_noise(const CoreVector& x, double t, const ProcessNoise& noise) {
  CoreMatrix q = CoreMatrix::Zero();
  if (noise.diagonal) {
    q.diagonal() << noise.position * t, noise.position * t, noise.accel * t, noise.jerk * t, noise.yaw * t,
        noise.yaw_accel * t, noise.yaw_jerk * t;
    return q;
  }
  const double c = std::cos(x(kYaw)), s = std::sin(x(kYaw)), v = x(kSpeed);
  const double t2 = t * t, t3 = t2 * t, t4 = t3 * t, t5 = t4 * t;
  // (path s, speed, accel) and (yaw, yaw rate, yaw accel): integrated white noise.
  const auto chain = [&](double third, double second, double first, Eigen::Matrix3d& m) {
    m << third * t5 / 20 + second * t3 / 3 + first * t, third * t4 / 8 + second * t2 / 2, third * t3 / 6,
        third * t4 / 8 + second * t2 / 2, third * t3 / 3 + second * t, third * t2 / 2,  //
        third * t3 / 6, third * t2 / 2, third * t;
  };
  Eigen::Matrix3d along, turn;
  chain(noise.jerk, noise.accel, 0.0, along);
  chain(noise.yaw_jerk, noise.yaw_accel, noise.yaw, turn);
  // The heading's noise moves the path sideways: n = v * integral of psi.
  const double cross = v * v * (noise.yaw_jerk * t5 * t2 / 252 + noise.yaw_accel * t5 / 20 + noise.yaw * t3 / 3);
  const double cross_yaw = v * (noise.yaw_jerk * t5 * t / 72 + noise.yaw_accel * t4 / 8 + noise.yaw * t2 / 2);
  const double cross_rate = v * (noise.yaw_jerk * t5 / 30 + noise.yaw_accel * t3 / 6);
  const double cross_accel = v * noise.yaw_jerk * t4 / 24;
  q(kX, kX) = along(0, 0) * c * c + cross * s * s + noise.position * t;
  q(kY, kY) = along(0, 0) * s * s + cross * c * c + noise.position * t;
  q(kX, kY) = (along(0, 0) - cross) * c * s;
  const auto path = [&](int i, double value) {
    q(kX, i) = value * c;
    q(kY, i) = value * s;
  };
  const auto side = [&](int i, double value) {
    q(kX, i) = -value * s;
    q(kY, i) = value * c;
  };
  path(kSpeed, along(0, 1));
  path(kAccel, along(0, 2));
  side(kYaw, cross_yaw);
  side(kYawRate, cross_rate);
  side(kYawAccel, cross_accel);
  q.block<2, 2>(kSpeed, kSpeed) = along.bottomRightCorner<2, 2>();
  q.block<3, 3>(kYaw, kYaw) = turn;
  return CoreMatrix(q.selfadjointView<Eigen::Upper>());
}

void predict(FilterState& state, std::int64_t to_ns, const ProcessConfig& config) {
  if (to_ns <= state.stamp_ns) return;
  if (config.decay_tau_s <= 0.0 || state.last_motion_ns == kNoStamp) {
    advance(state, to_ns, 0.0, config);
    return;
  }
  const std::int64_t hold_until = state.last_motion_ns + static_cast<std::int64_t>(config.hold_s * 1e9);
  advance(state, std::min(to_ns, hold_until), 0.0, config);
  advance(state, to_ns, config.decay_tau_s, config);
}

}  // namespace adit::state_estimator
