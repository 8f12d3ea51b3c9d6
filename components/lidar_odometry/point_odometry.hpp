// The published methods: KISS-ICP (Vizzo et al., RA-L 2023) and GenZ-ICP (Lee et al., RA-L 2025).
#pragma once

#include <vector>

#include "components/lidar_odometry/adaptive_threshold.hpp"
#include "components/lidar_odometry/config.hpp"
#include "components/lidar_odometry/pipeline.hpp"
#include "components/lidar_odometry/point_map.hpp"
#include "components/lidar_odometry/point_registration.hpp"

namespace adit::lidar_odometry {

class PointOdometry final : public Pipeline {
 public:
  // Precondition: check(config) succeeds, config.mode is kiss or genz.
  PointOdometry(const Config& config, WorkerPool& pool);

  void process(const SweepTask& task, Estimate& estimate) override;
  void reset() override;

 private:
  // Two voxel passes: points_ -> map_points_ (for the map) -> registration_points_.
  void select_points();

  Config config_;
  bool genz_;
  WorkerPool& pool_;
  AdaptiveThreshold threshold_;
  PointMap map_;
  PointRegistration registration_;
  VoxelFilter filter_;
  std::vector<Eigen::Vector3d> points_, map_points_, registration_points_;
  double scan_voxel_;  // genz: adaptive
  Eigen::Vector3d start_ = Eigen::Vector3d::Zero();
};

}  // namespace adit::lidar_odometry
