// Sweeps that wait for the odometry of their end, and the odometry they wait for. A plain library; bounded.
#pragma once

#include <deque>
#include <optional>

#include "components/mapping/cloud.hpp"

namespace adit::mapping {

// A sweep that owns its points.
struct OwnedSweep {
  std::int64_t stamp_ns = 0;
  Points points;
  std::vector<float> seconds;
  Eigen::Vector3d unobserved = Eigen::Vector3d::Zero();

  Sweep view() const { return {stamp_ns, points, seconds}; }
};

class SweepBuffer {
 public:
  static constexpr std::size_t most_sweeps = 4;
  static constexpr std::size_t most_poses = 2000;  // 10 s of 200 Hz

  // T_odom_sensor. False: not finite, or its stamp is not after the last one's: left out.
  bool add(const StampedPose& pose);
  // The oldest one is dropped when too many wait: true then.
  bool add(OwnedSweep sweep);
  // The oldest sweep, once the odometry covers its end.
  std::optional<OwnedSweep> next();
  const Trajectory& poses() const { return poses_; }
  void clear();

 private:
  Trajectory poses_;
  std::deque<OwnedSweep> sweeps_;
};

}  // namespace adit::mapping
