#include "components/thermal_odometry/prior_motion.hpp"

#include <algorithm>
#include <cmath>

namespace adit::thermal_odometry {

bool PriorMotion::add(const BodyMotion& motion) {
  if (!motion.pose.matrix().allFinite() || !motion.twist.allFinite()) return false;
  constexpr std::int64_t clock_set_back_ns = 1'000'000'000;  // no estimator repeats or reorders as much as this
  if (!samples_.empty() && motion.stamp_ns < samples_.newest().stamp_ns - clock_set_back_ns) clear();
  if (!samples_.empty() && motion.stamp_ns <= samples_.newest().stamp_ns) return false;
  samples_.push(motion);
  return true;
}

std::optional<Pose> PriorMotion::at(std::int64_t stamp_ns) const {
  if (samples_.empty()) return std::nullopt;
  const BodyMotion& newest = samples_.newest();
  if (stamp_ns >= newest.stamp_ns) {
    const double ahead = 1e-9 * static_cast<double>(stamp_ns - newest.stamp_ns);
    if (ahead > config_.max_extrapolation_s) return std::nullopt;
    return newest.pose * se3_exp(ahead * newest.twist);
  }
  for (std::size_t next = samples_.size() - 1; next > 0; --next) {
    const BodyMotion& before = samples_[next - 1];
    if (before.stamp_ns > stamp_ns) continue;
    const BodyMotion& after = samples_[next];
    const auto span = static_cast<double>(after.stamp_ns - before.stamp_ns);
    if (1e-9 * span > config_.max_gap_s) return std::nullopt;
    return se3_interpolate(before.pose, after.pose, static_cast<double>(stamp_ns - before.stamp_ns) / span);
  }
  return std::nullopt;
}

std::optional<Prior> PriorMotion::between(std::int64_t from_ns, std::int64_t to_ns) const {
  const std::optional<Pose> from = at(from_ns);
  const std::optional<Pose> to = at(to_ns);
  if (!from || !to || to_ns <= from_ns) return std::nullopt;
  const Pose& camera = config_.body_from_camera;
  Prior prior;
  prior.T_previous_current = camera.inverse() * (from->inverse() * *to) * camera;
  // Errors of the twist over the interval, about the body's axes at its start, carried to the camera's.
  const double dt = 1e-9 * static_cast<double>(to_ns - from_ns);
  const Vector6d& reported = samples_.newest().twist_variance;
  Vector6d variance;
  for (int i = 0; i < 6; ++i) {
    const double usual = i < 3 ? config_.usual_speed_sigma : config_.usual_rate_sigma;
    const bool known = reported[i] > 0.0 && reported[i] < 1e5;
    variance[i] = std::max(known ? reported[i] : usual * usual, 1e-10) * dt * dt;
  }
  const Matrix6d to_camera = se3_adjoint(camera.inverse());
  prior.covariance = to_camera * variance.asDiagonal() * to_camera.transpose();
  return prior;
}

}  // namespace adit::thermal_odometry
