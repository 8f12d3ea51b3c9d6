#include "bringup/evaluation/decomposition.hpp"

#include <cmath>

namespace adit::evaluation {
namespace {

Eigen::Vector2d turned(const Eigen::Vector2d& v, double angle) {
  return {std::cos(angle) * v.x() - std::sin(angle) * v.y(), std::sin(angle) * v.x() + std::cos(angle) * v.y()};
}

}  // namespace

Decomposition decompose(const std::vector<Sample>& samples) {
  Decomposition result;
  if (samples.size() < 2) return result;
  // Steps of the estimate, turned by minus the heading error in their middle, and those of the truth.
  std::vector<Eigen::Vector2d> with_yaw{Eigen::Vector2d::Zero()};
  double true_way = 0.0,
         way = 0.0;  // of the estimate: along the truth's direction, so that its noise does not lengthen it
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const Sample &a = samples[i - 1], &b = samples[i];
    const double error = a.start_yaw_error_rad + 0.5 * wrap_angle(b.start_yaw_error_rad - a.start_yaw_error_rad);
    const Eigen::Vector2d step = turned((b.start_aligned - a.start_aligned).head<2>(), -error);
    const Eigen::Vector2d truth = (b.truth.translation() - a.truth.translation()).head<2>();
    const double length = truth.norm();
    if (length > 1e-6) {
      true_way += length;
      way += step.dot(truth) / length;
    }
    with_yaw.push_back(with_yaw.back() + step);
  }
  result.speed_scale = way > 0.0 ? true_way / way : 1.0;
  const Eigen::Vector2d origin = samples.front().truth.translation().head<2>();
  ErrorParts sum;
  Eigen::Vector2d last_turned = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Eigen::Vector2d truth = samples[i].truth.translation().head<2>() - origin;
    const Eigen::Vector2d total = samples[i].start_aligned.head<2>() - origin - truth;
    const Eigen::Vector2d after_yaw = with_yaw[i] - truth;
    const Eigen::Vector2d after_scale = result.speed_scale * with_yaw[i] - truth;
    last_turned = after_yaw;
    const ErrorParts parts{total.norm(), (total - after_yaw).norm(), (after_yaw - after_scale).norm(),
                           after_scale.norm()};
    result.series.push_back(parts);
    sum.total_m += parts.total_m * parts.total_m;
    sum.yaw_m += parts.yaw_m * parts.yaw_m;
    sum.scale_m += parts.scale_m * parts.scale_m;
    sum.rest_m += parts.rest_m * parts.rest_m;
  }
  const auto n = static_cast<double>(samples.size());
  result.rms = {std::sqrt(sum.total_m / n), std::sqrt(sum.yaw_m / n), std::sqrt(sum.scale_m / n),
                std::sqrt(sum.rest_m / n)};
  result.end = result.series.back();
  if (result.end.total_m > 1e-9) result.yaw_share = 1.0 - last_turned.norm() / result.end.total_m;
  return result;
}

}  // namespace adit::evaluation
