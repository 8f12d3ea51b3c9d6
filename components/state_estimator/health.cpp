#include "components/state_estimator/health.hpp"

#include <algorithm>
#include <cmath>

namespace adit::state_estimator {
namespace {

bool fresh(const MotionWindow& window, std::int64_t now_ns, const DisagreementConfig& config) {
  return window.stamp_ns != kNoStamp && std::abs(seconds_between(window.stamp_ns, now_ns)) <= config.fresh_s;
}

bool has_speed(const MotionWindow& window, const DisagreementConfig& config) {
  return window.speed_stamp_ns != kNoStamp && seconds_between(window.speed_stamp_ns, window.stamp_ns) <= config.fresh_s;
}

double speed_distance(const MotionWindow& a, const MotionWindow& b, const DisagreementConfig& config) {
  if (!has_speed(a, config) || !has_speed(b, config)) return 0.0;
  const double model =
      square(config.speed_floor) + square(config.speed_fraction * std::max(std::abs(a.speed), std::abs(b.speed)));
  return square(a.speed - b.speed) / (a.speed_variance + b.speed_variance + model);
}

double yaw_rate_distance(const MotionWindow& a, const MotionWindow& b, const DisagreementConfig& config) {
  return square(a.yaw_rate - b.yaw_rate) / (a.yaw_rate_variance + b.yaw_rate_variance + square(config.yaw_rate_floor));
}

// How much speaks against sensor i when it contradicts sensor j.
double doubt(const SensorState& i, const SensorState& j, bool standing, const DisagreementConfig& config) {
  double value = i.window.suspicion;
  const bool speeds = has_speed(i.window, config) && has_speed(j.window, config);
  const bool i_stands = std::abs(i.window.speed) < config.zero_speed + 0.1 * std::abs(j.window.speed);
  const bool j_moves = std::abs(j.window.speed) > 4.0 * config.zero_speed;
  // A sensor that sees nothing move is the usual way to be wrong, unless the IMU says so too.
  if (speeds && i_stands && j_moves && !standing) value += 0.5;
  if (speeds && standing && std::abs(i.window.speed) > 4.0 * config.zero_speed) value += 0.8;
  // The one that departs from the motion that both had measured before is the less likely.
  const bool surprises = 1.0 + i.window.surprise > config.surprise_ratio * (1.0 + j.window.surprise);
  if (surprises || i.consecutive_rejections >= 2) value += 0.4;
  return value;
}

// With nobody left to agree with, distrust lapses after a while: one doubtful sensor is better than none for ever.
void release_when_alone(FilterState& state, std::int64_t now_ns, const DisagreementConfig& config) {
  for (SensorState& s : state.sensors) {
    const auto speaks = [&](const SensorState& other) {
      return &other != &s && other.window.stamp_ns != kNoStamp &&
             seconds_between(other.window.stamp_ns, now_ns) <= config.patience_s;
    };
    if (s.is_distrusted && std::none_of(state.sensors.begin(), state.sensors.end(), speaks)) s.is_distrusted = false;
  }
  state.conflict = false;
}

}  // namespace

void observe_motion(FilterState& state, int sensor, std::int64_t stamp_ns, const Motion& motion, double speed_scale,
                    const DisagreementConfig& config) {
  if (!motion.valid) return;
  MotionWindow& w = state.sensors[static_cast<std::size_t>(sensor)].window;
  const bool restart = !fresh(w, stamp_ns, config);
  const double dt = restart ? config.window_s : std::max(0.0, seconds_between(w.stamp_ns, stamp_ns));
  const double gain = restart ? 1.0 : -std::expm1(-dt / config.window_s);
  const auto average = [](double& mean, double& variance, double value, double value_variance, double g) {
    mean += g * (value - mean);
    variance = square(1.0 - g) * variance + square(g) * value_variance;
  };
  average(w.yaw_rate, w.yaw_rate_variance, motion.yaw_rate, motion.yaw_rate_variance, gain);
  if (motion.has_speed) {
    const double g = has_speed(w, config) ? gain : 1.0;
    average(w.speed, w.speed_variance, motion.speed / speed_scale, motion.speed_variance / square(speed_scale), g);
    w.speed_stamp_ns = stamp_ns;
  }
  w.suspicion += gain * (motion.suspicion - w.suspicion);
  w.stamp_ns = stamp_ns;
  const bool zero = motion.has_speed && std::abs(motion.speed) < config.zero_speed;
  if (!zero) {
    w.zero_since_ns = kNoStamp;
  } else if (w.zero_since_ns == kNoStamp) {
    w.zero_since_ns = stamp_ns;
  }
}

void observe_surprise(MotionWindow& window, double nis_per_dof) {
  constexpr double gain = 0.3, most = 100.0;
  window.surprise += gain * (std::min(nis_per_dof, most) - window.surprise);
}

bool disagree(const MotionWindow& a, const MotionWindow& b, const DisagreementConfig& config) {
  return speed_distance(a, b, config) > config.threshold || yaw_rate_distance(a, b, config) > config.threshold;
}

void judge(FilterState& state, std::int64_t now_ns, bool standing, const DisagreementConfig& config) {
  if (!config.enabled) return;
  int against[kMaxSensors] = {};
  double doubts[kMaxSensors] = {};
  int present = 0;
  bool any = false;
  for (int i = 0; i < kMaxSensors; ++i) {
    const SensorState& a = state.sensors[static_cast<std::size_t>(i)];
    if (!fresh(a.window, now_ns, config)) continue;
    ++present;
    for (int j = 0; j < kMaxSensors; ++j) {
      const SensorState& b = state.sensors[static_cast<std::size_t>(j)];
      if (j == i || !fresh(b.window, now_ns, config) || !disagree(a.window, b.window, config)) continue;
      any = true;
      ++against[i];
      doubts[i] = std::max(doubts[i], doubt(a, b, standing, config));
    }
  }
  if (!any) {
    state.conflict_since_ns = kNoStamp;
    if (present < 2) {
      release_when_alone(state, now_ns, config);
      return;
    }
    if (state.agreement_since_ns == kNoStamp) state.agreement_since_ns = now_ns;
    if (seconds_between(state.agreement_since_ns, now_ns) < config.release_s) return;
    state.conflict = false;
    for (SensorState& s : state.sensors) {
      if (fresh(s.window, now_ns, config)) s.is_distrusted = false;
    }
    return;
  }
  state.agreement_since_ns = kNoStamp;
  if (state.conflict_since_ns == kNoStamp) state.conflict_since_ns = now_ns;
  if (seconds_between(state.conflict_since_ns, now_ns) < config.persistence_s) return;
  // The sensor with most others against it, or, one against one, with clearly more doubt, is wrong.
  int worst = -1;
  bool decided = false;
  for (int i = 0; i < kMaxSensors; ++i) {
    if (against[i] == 0) continue;
    if (worst < 0) {
      worst = i;
      decided = true;
      continue;
    }
    const double lead = (against[i] - against[worst]) + (doubts[i] - doubts[worst]);
    decided = std::abs(lead) > config.evidence_margin;
    if (lead > 0.0) worst = i;
  }
  for (int i = 0; i < kMaxSensors; ++i) {
    if (against[i] > 0) state.sensors[static_cast<std::size_t>(i)].is_distrusted = decided && i == worst;
  }
  state.conflict = !decided;
}

double conflict_inflation(const FilterState& state, int sensor, const DisagreementConfig& config) {
  if (!config.enabled || !state.conflict) return 1.0;
  const MotionWindow& own = state.sensors[static_cast<std::size_t>(sensor)].window;
  double worst = 0.0;
  for (const SensorState& other : state.sensors) {
    if (&other.window == &own || !fresh(other.window, own.stamp_ns, config)) continue;
    const double v = has_speed(own, config) && has_speed(other.window, config)
                         ? square(own.speed - other.window.speed) / std::max(own.speed_variance, 1e-6)
                         : 0.0;
    const double w = square(own.yaw_rate - other.window.yaw_rate) / std::max(own.yaw_rate_variance, 1e-10);
    worst = std::max({worst, v, w});
  }
  return 1.0 + worst;
}

}  // namespace adit::state_estimator
