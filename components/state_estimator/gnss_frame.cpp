#include "components/state_estimator/gnss_frame.hpp"

#include <cmath>
#include <numbers>

namespace adit::state_estimator {
namespace {

constexpr double kRadians = std::numbers::pi / 180.0;

// WGS 84.
Eigen::Vector3d earth_centred(const Geodetic& point) {
  constexpr double a = 6378137.0, flattening = 1.0 / 298.257223563, e2 = flattening * (2.0 - flattening);
  const double latitude = kRadians * point.latitude, longitude = kRadians * point.longitude;
  const double n = a / std::sqrt(1.0 - e2 * std::sin(latitude) * std::sin(latitude));
  return {(n + point.altitude) * std::cos(latitude) * std::cos(longitude),
          (n + point.altitude) * std::cos(latitude) * std::sin(longitude),
          (n * (1.0 - e2) + point.altitude) * std::sin(latitude)};
}

Eigen::Matrix2d turn(double angle) {
  return (Eigen::Matrix2d() << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle)).finished();
}

}  // namespace

Eigen::Vector3d to_local(const Geodetic& origin, const Geodetic& point) {
  const double latitude = kRadians * origin.latitude, longitude = kRadians * origin.longitude;
  const Eigen::Vector3d d = earth_centred(point) - earth_centred(origin);
  const double east = -std::sin(longitude) * d.x() + std::cos(longitude) * d.y();
  const double outward = std::cos(longitude) * d.x() + std::sin(longitude) * d.y();
  return {east, -std::sin(latitude) * outward + std::cos(latitude) * d.z(),
          std::cos(latitude) * outward + std::sin(latitude) * d.z()};
}

void GnssFrame::set(const Eigen::Vector2d& origin, double heading) {
  origin_ = origin;
  heading_ = heading;
  heading_variance_ = 0.0;
  aligned_ = true;
}

bool GnssFrame::add(const Eigen::Vector2d& local, double sigma, const Eigen::Vector2d& antenna_in_odom) {
  if (aligned_ || !local.allFinite() || !antenna_in_odom.allFinite() || !(sigma <= config_.max_sigma_m)) return false;
  if (pairs_.size() >= config_.max_pairs) return false;
  pairs_.push_back({local, antenna_in_odom});
  sigma_sum_ += sigma;
  if ((pairs_.back().odom - pairs_.front().odom).norm() < config_.baseline_m) return false;
  Eigen::Vector2d local_mean = Eigen::Vector2d::Zero(), odom_mean = Eigen::Vector2d::Zero();
  for (const Pair& p : pairs_) {
    local_mean += p.local;
    odom_mean += p.odom;
  }
  const auto n = static_cast<double>(pairs_.size());
  local_mean /= n;
  odom_mean /= n;
  double sine = 0.0, cosine = 0.0, spread = 0.0;
  for (const Pair& p : pairs_) {
    const Eigen::Vector2d a = p.odom - odom_mean, b = p.local - local_mean;
    sine += a.x() * b.y() - a.y() * b.x();
    cosine += a.dot(b);
    spread += a.squaredNorm();
  }
  set(Eigen::Vector2d::Zero(), std::atan2(sine, cosine));
  origin_ = local_mean - turn(heading_) * odom_mean;
  centre_ = odom_mean;
  // Neighbouring fixes share their errors: ten independent ones are believed at most.
  const double mean_sigma = sigma_sum_ / n;
  heading_variance_ = mean_sigma * mean_sigma / spread * std::max(1.0, n / 10.0);
  pairs_.clear();
  return true;
}

GnssFrame::Fix GnssFrame::to_odom(const Eigen::Vector2d& local, const Eigen::Matrix2d& covariance) const {
  const Eigen::Matrix2d back = turn(heading_).transpose();
  Fix fix;
  fix.position = back * (local - origin_);
  const Eigen::Vector2d arm = fix.position - centre_;
  const Eigen::Vector2d across(-arm.y(), arm.x());
  fix.covariance = back * covariance * back.transpose() + heading_variance_ * across * across.transpose();
  return fix;
}

}  // namespace adit::state_estimator
