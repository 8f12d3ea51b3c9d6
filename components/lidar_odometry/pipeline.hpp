// What LidarOdometry asks of each of its methods.
#pragma once

#include <optional>

#include "components/lidar_odometry/cloud.hpp"
#include "components/lidar_odometry/estimate.hpp"
#include "components/lidar_odometry/sweep.hpp"

namespace adit::lidar_odometry {

// One sweep, checked, with all that is known before its registration. Poses are T_map_sensor of the local map's frame.
struct SweepTask {
  const Cloud& cloud;
  std::optional<TimeSpan> times = std::nullopt;  // nothing: the points need no compensation
  double reference_time = 0.0;                   // s after the stamp: the instant of the pose
  double dt = 0.0;                               // s since the instant of the last pose; 0 for the first sweep
  Pose last = Pose::Identity();
  Pose prediction = Pose::Identity();
  Vector6d twist = Vector6d::Zero();               // predicted, sensor frame
  Matrix6d information = Matrix6d::Zero();         // of the prediction, if it came from outside; right perturbation
  bool external = false;                           // the prediction came from outside
  std::optional<Pose> coasting = std::nullopt;     // where the velocity of the last sweeps leads, if it is known
  bool external_twist = false;                     // the twist came from outside
  SweepMotion sampled = {};                        // within the sweep, if it came from outside; else not moving()
  Matrix6d sampled_covariance = Matrix6d::Zero();  // of a twist that it is wrong by
};

// Fills status, pose, information, localizability and scan of the estimate; the pose in the local map's frame.
// Refusals (too_few_points, lost) leave the local map as it was and the pose at the prediction.
class Pipeline {
 public:
  virtual ~Pipeline() = default;
  virtual void process(const SweepTask& task, Estimate& estimate) = 0;
  // Forgets the local map and all that was learnt. The next sweep is the first one of a new map, at its prediction.
  virtual void reset() = 0;
};

}  // namespace adit::lidar_odometry
