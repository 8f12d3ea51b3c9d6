#include "components/state_estimator/filter.hpp"

#include <algorithm>
#include <cmath>

#include "components/state_estimator/correction.hpp"

namespace adit::state_estimator {
namespace {

// A front end's own account of its scale. What its variance grows by, the scale has drifted since. When it falls, the
// lengths were measured anew (LiDAR depth): the scale is then as at the start and has nothing to do with the one
// before.
void follow_scale(FilterState& state, SensorState& sensor, double told, double start_sigma) {
  constexpr double fallen = 0.9;  // less is rounding
  const double last = sensor.log_scale_sigma;
  sensor.log_scale_sigma = told;
  sensor.least_log_scale_sigma = last > 0.0 ? std::min(sensor.least_log_scale_sigma, told) : told;
  double& variance = state.p(kScale, kScale);
  if (last <= 0.0 || variance <= 0.0) return;
  if (told < fallen * last) {
    state.x(kScale) = 0.0;
    state.p.row(kScale).setZero();
    state.p.col(kScale).setZero();
    variance = start_sigma * start_sigma + told * told - sensor.least_log_scale_sigma * sensor.least_log_scale_sigma;
  } else if (told > last) {
    variance += told * told - last * last;
  }
}

}  // namespace

int Filter::add_sensor(SensorModel sensor) {
  if (count_ == kMaxSensors) return -1;
  sensors_[static_cast<std::size_t>(count_)] = std::move(sensor);
  return count_++;
}

void Filter::apply(FilterState& state, const Measurement& m) const {
  const SensorModel& sensor = sensors_[m.sensor];
  SensorState& statistics = state.sensors[m.sensor];
  predict(state, m.stamp_ns, process);
  if (m.kind == Measurement::Kind::clone) {
    state.clone(sensor.clone_slot);
    return;
  }
  statistics.last_received_ns = m.stamp_ns;
  if (sensor.scaled && m.log_scale_sigma > 0.0) follow_scale(state, statistics, m.log_scale_sigma, scale_sigma);
  if (sensor.moves) {
    const double scale = sensor.scaled ? std::exp(state.x(kScale)) : 1.0;
    observe_motion(state, m.sensor, m.stamp_ns, m.motion, scale, disagreement);
    judge(state, m.stamp_ns, stands(state), disagreement);
  }
  const bool anchored =
      sensor.clone_slot < 0 || state.clone_stamp_ns[static_cast<std::size_t>(sensor.clone_slot)] == m.anchor_ns;
  Innovation innovation;
  if (!anchored) {
    ++statistics.unanchored;
  } else if (m.rows == 0) {
    ++statistics.uninformative;
  } else if (examine(state, m, sensor, innovation)) {
    if (correct(state, innovation)) {
      ++statistics.accepted;
      statistics.last_accepted_ns = m.stamp_ns;
      if (sensor.moves) state.last_motion_ns = m.stamp_ns;
    } else {
      ++statistics.rejected;
    }
  }
  if (sensor.reanchor) state.clone(sensor.clone_slot);
}

// Fills the innovation, with its noise as the situation demands; false when the measurement is not to be used.
bool Filter::examine(FilterState& state, const Measurement& m, const SensorModel& sensor,
                     Innovation& innovation) const {
  SensorState& statistics = state.sensors[m.sensor];
  innovation = project(state, sensor.model->linearize(state, m), m);
  if (sensor.moves && m.rows > 0) {
    observe_surprise(statistics.window, std::max(0.0, squared_distance(innovation)) / m.rows);
  }
  if (sensor.moves) innovation.covariance *= conflict_inflation(state, m.sensor, disagreement);
  const bool disbelieved = m.motion.suspicion >= 1.0;  // by its own front end
  if (disagreement.enabled && !disbelieved) innovation.covariance /= square(1.0 - m.motion.suspicion);
  const bool adapts = adaptation.enabled && sensor.adapts;
  if (adapts) innovation.covariance *= statistics.noise.factor;
  const double nis = squared_distance(innovation);
  statistics.nis = nis;
  statistics.nis_dof = m.rows;
  if (!(nis >= 0.0)) {
    ++statistics.rejected;
    return false;
  }
  ++statistics.examined;
  statistics.nis_per_dof_sum += nis / m.rows;
  const bool moving = std::abs(state.x(kSpeed)) > 0.1 || std::abs(state.x(kYawRate)) > 0.03;
  if (disagreement.enabled && (statistics.is_distrusted || disbelieved || (m.motion.frozen && moving))) {
    ++statistics.distrusted;
    return false;
  }
  if (adapts && !state.conflict) {
    statistics.noise.add(nis, m.rows, noise_share(innovation), adaptation);
  }
  if (!gate.enabled || !sensor.gated) return true;
  const double certain = chi_square(m.rows, Quantile::p95);
  if (nis > chi_square(m.rows, Quantile::p99_9)) {
    ++statistics.consecutive_rejections;
    if (!let_in_again(state, m)) {
      ++statistics.rejected;
      return false;
    }
    ++statistics.forced;
    see_from(state, innovation);
  } else if (gate.robust && nis > certain) {
    innovation.covariance *= std::sqrt(nis / certain);  // Huber: weight sqrt(c / nis)
  }
  statistics.consecutive_rejections = 0;
  return true;
}

bool Filter::let_in_again(FilterState& state, const Measurement& m) const {
  const SensorState& own = state.sensors[m.sensor];
  if (own.consecutive_rejections < gate.lockout_rejections) return false;
  if (!sensors_[m.sensor].moves) return true;
  for (int i = 0; i < count_; ++i) {
    const SensorState& other = state.sensors[static_cast<std::size_t>(i)];
    if (i == m.sensor || other.window.stamp_ns == kNoStamp) continue;
    const bool present = seconds_between(other.window.stamp_ns, m.stamp_ns) <= disagreement.fresh_s;
    if (present && disagree(own.window, other.window, disagreement)) return false;
  }
  const bool claims_rest = own.window.zero_since_ns != kNoStamp && !stands(state);
  if (claims_rest && seconds_between(own.window.zero_since_ns, m.stamp_ns) < gate.zero_motion_patience_s) return false;
  const double speed = m.motion.has_speed ? m.motion.speed - state.x(kSpeed) : 0.0;
  const double yaw_rate = m.motion.valid ? m.motion.yaw_rate - state.x(kYawRate) : 0.0;
  state.p(kSpeed, kSpeed) += std::max(gate.lockout_speed * gate.lockout_speed, speed * speed);
  state.p(kYawRate, kYawRate) += std::max(gate.lockout_yaw_rate * gate.lockout_yaw_rate, yaw_rate * yaw_rate);
  return true;
}

bool Filter::stands(const FilterState& state) const {
  for (int i = 0; i < count_; ++i) {
    const SensorState& s = state.sensors[static_cast<std::size_t>(i)];
    if (sensors_[static_cast<std::size_t>(i)].standstill && s.last_accepted_ns != kNoStamp &&
        seconds_between(s.last_accepted_ns, state.stamp_ns) < 0.5) {
      return true;
    }
  }
  return false;
}

}  // namespace adit::state_estimator
