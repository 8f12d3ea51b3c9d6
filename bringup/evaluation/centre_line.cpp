#include "bringup/evaluation/centre_line.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace adit::evaluation {
namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

}  // namespace

CentreLine::CentreLine(const std::vector<Eigen::Vector2d>& points) {
  for (const Eigen::Vector2d& p : points) {
    const double step = points_.empty() ? 0.0 : (p - points_.back()).norm();
    if (!points_.empty() && step < 1e-3) continue;
    stations_.push_back(points_.empty() ? 0.0 : stations_.back() + step);
    points_.push_back(p);
  }
}

CentreLine::Place CentreLine::nearest(const Eigen::Vector2d& point, double from, double to,
                                      const Eigen::Vector2d* heading) const {
  Place best;
  best.distance = std::numeric_limits<double>::infinity();
  const auto first = std::upper_bound(stations_.begin(), stations_.end(), from);
  std::size_t i = first == stations_.begin() ? 0 : static_cast<std::size_t>(first - stations_.begin()) - 1;
  for (i = std::min(i, points_.size() - 2); i + 1 < points_.size() && stations_[i] <= to; ++i) {
    const Eigen::Vector2d direction = (points_[i + 1] - points_[i]).normalized();
    if (heading != nullptr && std::abs(direction.dot(*heading)) < std::sqrt(0.5)) continue;
    double along = direction.dot(point - points_[i]);
    if (i > 0) along = std::max(along, 0.0);  // before the first point and after the last one the line goes on
    if (i + 2 < points_.size()) along = std::min(along, stations_[i + 1] - stations_[i]);
    const Eigen::Vector2d offset = point - (points_[i] + along * direction);
    if (offset.norm() >= best.distance) continue;
    best = {stations_[i] + along, std::copysign(offset.norm(), cross(direction, offset)), offset.norm(), direction};
  }
  return best;
}

CentreLine::Split CentreLine::split(const Pose& truth, const Eigen::Vector3d& estimate) const {
  const double angle = yaw(truth.linear());
  const Eigen::Vector2d heading(std::cos(angle), std::sin(angle));
  const Eigen::Vector2d error = (estimate - truth.translation()).head<2>();
  const Split straight{heading.dot(error), cross(heading, error)};
  if (points_.size() < 2) return straight;
  const double all = std::numeric_limits<double>::infinity();
  const Place t = nearest(truth.translation().head<2>(), -all, all, &heading);
  if (!std::isfinite(t.distance)) return straight;
  const double reach = 2.0 * error.norm() + 1.0;
  const Place e = nearest(estimate.head<2>(), t.station - reach, t.station + reach, nullptr);
  const double sense = t.direction.dot(heading) >= 0.0 ? 1.0 : -1.0;
  return {sense * (e.station - t.station), sense * (e.left - t.left)};
}

}  // namespace adit::evaluation
