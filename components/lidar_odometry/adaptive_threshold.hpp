// The scale of the registration from how wrong the motion prediction has been (KISS-ICP, section III-C).
#pragma once

#include "components/geometry/se3.hpp"

namespace adit::lidar_odometry {

class AdaptiveThreshold {
 public:
  enum class Rule {
    kiss,  // running mean that starts with the initial value as its first sample
    genz,  // mean of the samples alone; the initial value within 5 min_motion of the first pose or without samples
  };
  AdaptiveThreshold(Rule rule, double initial, double min_motion, double max_range);

  // Deviation of an estimated pose from its prediction: translation plus what the rotation moves a point at max_range.
  void add(const Pose& prediction, const Pose& estimate);
  // Standard deviation sigma [m]; distance_from_start: of the current position [m].
  double sigma(double distance_from_start) const;
  void reset();

 private:
  Rule rule_;
  double initial_, min_motion_, max_range_;
  double sum2_ = 0.0;
  double count_ = 0.0;
};

}  // namespace adit::lidar_odometry
