#include "components/lidar_odometry/motion_prior.hpp"

#include <algorithm>

#include <Eigen/Cholesky>

#include "components/geometry/rigid.hpp"

namespace adit::lidar_odometry {
namespace {

constexpr double ns = 1e-9;
// What is believed where neither the messages nor the settings say anything.
constexpr double usual_velocity_sigma = 0.3, usual_rate_sigma = 0.1;  // m/s, rad/s
// No odometry is taken to be better than this over one sweep.
constexpr double least_translation = 3e-3, least_rotation = 2e-3;  // m, rad
constexpr double vehicle_acceleration = 3.0;                       // m/s^2, over the time that is extrapolated
constexpr double good_rate_sigma = 0.02;                           // rad/s: like a gyroscope

double seconds(std::int64_t from_ns, std::int64_t to_ns) {
  return ns * static_cast<double>(to_ns - from_ns);
}

}  // namespace

MotionPrior::MotionPrior(const MotionPriorConfig& config)
    : config_(config), to_sensor_(se3_adjoint(config.sensor.inverse())) {}

bool MotionPrior::add(const MotionSample& sample) {
  if (!is_rigid(sample.pose) || !sample.twist.allFinite() || sample.twist.norm() > 1e3) return false;
  if (!samples_.empty() && sample.stamp_ns <= samples_.newest().stamp_ns) return false;
  samples_.push(sample);
  return true;
}

void MotionPrior::clear() {
  samples_.clear();
}

bool MotionPrior::covers(std::int64_t from_ns, std::int64_t to_ns) const {
  return to_ns > from_ns &&
         samples_.covers(from_ns, to_ns, samples_.size(), config_.max_extrapolation_s, config_.max_gap_s);
}

Pose MotionPrior::pose_at(std::int64_t stamp_ns) const {
  std::size_t next = 0;
  while (next < samples_.size() && samples_[next].stamp_ns < stamp_ns) ++next;
  if (next == 0 || next == samples_.size()) {
    const MotionSample& nearest = samples_[next == 0 ? 0 : samples_.size() - 1];
    return nearest.pose * se3_exp(seconds(nearest.stamp_ns, stamp_ns) * nearest.twist);
  }
  const MotionSample& a = samples_[next - 1];
  const MotionSample& b = samples_[next];
  return se3_interpolate(a.pose, b.pose, seconds(a.stamp_ns, stamp_ns) / seconds(a.stamp_ns, b.stamp_ns));
}

// Between two messages the mean of their velocities, outside them the nearest one's.
Pose MotionPrior::integrated(std::int64_t from_ns, std::int64_t to_ns) const {
  Pose motion = Pose::Identity();
  std::int64_t now = from_ns;
  for (std::size_t next = 0; now < to_ns; ++next) {
    const std::int64_t end = next < samples_.size() ? std::min(samples_[next].stamp_ns, to_ns) : to_ns;
    if (end <= now) continue;
    const Vector6d& before = samples_[next == 0 ? 0 : next - 1].twist;
    const Vector6d& after = samples_[std::min(next, samples_.size() - 1)].twist;
    motion = motion * se3_exp(0.5 * seconds(now, end) * (before + after));
    now = end;
  }
  return motion;
}

Matrix6d MotionPrior::velocity_covariance() const {
  Matrix6d covariance = samples_.newest().twist_covariance;
  const bool known = covariance.allFinite() && !covariance.isZero(0.0) && (covariance.diagonal().array() >= 0.0).all();
  if (!known) covariance.setZero();
  const auto set = [&](int first, double sigma) {
    covariance.middleRows<3>(first).setZero();
    covariance.middleCols<3>(first).setZero();
    covariance.diagonal().segment<3>(first).setConstant(sigma * sigma);
  };
  if (config_.velocity_sigma > 0.0 || !known) {
    set(0, config_.velocity_sigma > 0.0 ? config_.velocity_sigma : usual_velocity_sigma);
  }
  if (config_.rate_sigma > 0.0 || !known) set(3, config_.rate_sigma > 0.0 ? config_.rate_sigma : usual_rate_sigma);
  return to_sensor_ * covariance * to_sensor_.transpose();
}

std::optional<Prior> MotionPrior::between(std::int64_t from_ns, std::int64_t to_ns) const {
  if (!covers(from_ns, to_ns)) return std::nullopt;
  const Pose body =
      config_.differences ? Pose(pose_at(from_ns).inverse() * pose_at(to_ns)) : integrated(from_ns, to_ns);
  Prior prior;
  prior.pose = config_.sensor.inverse() * body * config_.sensor;
  prior.pose.linear() = orthonormalized(prior.pose.linear());

  const double dt = seconds(from_ns, to_ns);
  const double ahead = std::max(0.0, seconds(samples_.newest().stamp_ns, to_ns));
  const double drift = vehicle_acceleration * ahead * dt;
  Matrix6d covariance = velocity_covariance();
  const bool rates_known = (covariance.diagonal().tail<3>().array() < good_rate_sigma * good_rate_sigma).all();
  covariance *= dt * dt;
  covariance.diagonal().head<3>().array() += least_translation * least_translation + drift * drift;
  covariance.diagonal().tail<3>().array() += least_rotation * least_rotation;
  const Eigen::LDLT<Matrix6d> factors(covariance);
  if (factors.info() != Eigen::Success || !factors.isPositive()) return std::nullopt;
  prior.information = factors.solve(Matrix6d::Identity());
  prior.information = 0.5 * (prior.information + prior.information.transpose().eval());
  if (!prior.information.allFinite() || !prior.pose.matrix().allFinite()) return std::nullopt;
  if (rates_known) prior.twist = se3_log(prior.pose) / dt;
  return prior;
}

}  // namespace adit::lidar_odometry
