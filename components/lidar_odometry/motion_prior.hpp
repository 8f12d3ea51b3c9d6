// The motion between two sweeps as another odometry has it, e.g. the fused filter or wheels: from its messages to a
// Prior.
#pragma once

#include <cstdint>
#include <optional>

#include "components/geometry/stamped_ring.hpp"
#include "components/lidar_odometry/estimate.hpp"

namespace adit::lidar_odometry {

struct MotionPriorConfig {
  // Of the LiDAR in the frame that the odometry moves (its child frame, e.g. base_link).
  Pose sensor = Pose::Identity();
  // True: differences of the poses, for wheels and other dead reckoning. False: the velocities, integrated, for a
  // filter, whose poses jump by its corrections.
  bool differences = false;
  // Standard deviations of the velocities [m/s, rad/s]; 0: those of the messages.
  double velocity_sigma = 0.0, rate_sigma = 0.0;
  double max_extrapolation_s = 0.15;  // before the first and after the last message, with its velocity
  double max_gap_s = 0.5;             // between messages
};

// One message of nav_msgs/Odometry. A velocity is [m/s; rad/s] in the child frame, a covariance of all zeros unknown.
struct MotionSample {
  std::int64_t stamp_ns = 0;
  Pose pose = Pose::Identity();
  Vector6d twist = Vector6d::Zero();
  Matrix6d twist_covariance = Matrix6d::Zero();
};

// Keeps the last seconds of an odometry. No allocation after construction.
class MotionPrior {
 public:
  explicit MotionPrior(const MotionPriorConfig& config = {});

  // False: refused, since it is not finite, no rigid motion, or not later than the last one (repeated, out of order).
  bool add(const MotionSample& sample);
  void clear();

  // Motion of the sensor from one instant to a later one, with its information; nothing if the messages do not reach.
  // The velocity comes along when it is known in all directions well enough to compensate the motion in a sweep.
  std::optional<Prior> between(std::int64_t from_ns, std::int64_t to_ns) const;

 private:
  static constexpr std::size_t capacity = 512;  // 2.5 s at 200 Hz
  bool covers(std::int64_t from_ns, std::int64_t to_ns) const;
  Pose pose_at(std::int64_t stamp_ns) const;
  Pose integrated(std::int64_t from_ns, std::int64_t to_ns) const;
  Matrix6d velocity_covariance() const;

  MotionPriorConfig config_;
  Matrix6d to_sensor_;  // of velocities
  StampedRing<MotionSample> samples_{capacity};
};

}  // namespace adit::lidar_odometry
