#include "components/lidar_odometry/adaptive_threshold.hpp"

#include <cmath>

namespace adit::lidar_odometry {

AdaptiveThreshold::AdaptiveThreshold(Rule rule, double initial, double min_motion, double max_range)
    : rule_(rule), initial_(initial), min_motion_(min_motion), max_range_(max_range) {
  reset();
}

void AdaptiveThreshold::reset() {
  sum2_ = rule_ == Rule::kiss ? initial_ * initial_ : 0.0;
  count_ = rule_ == Rule::kiss ? 1.0 : 0.0;
}

void AdaptiveThreshold::add(const Pose& prediction, const Pose& estimate) {
  const Pose error = prediction.inverse() * estimate;
  const double angle = so3_log(error.linear()).norm();
  const double deviation = error.translation().norm() + 2.0 * max_range_ * std::sin(0.5 * angle);
  if (deviation <= min_motion_) return;
  sum2_ += deviation * deviation;
  count_ += 1.0;
}

double AdaptiveThreshold::sigma(double distance_from_start) const {
  if (count_ == 0.0) return initial_;
  if (rule_ == Rule::genz && distance_from_start <= 5.0 * min_motion_) return initial_;
  return std::sqrt(sum2_ / count_);
}

}  // namespace adit::lidar_odometry
