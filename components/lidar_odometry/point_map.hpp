// The local map of the published methods: a sparse grid of cells, each with the first few points that fell into it.
// Points are kept relative to their cell's corner in single precision, which is exact to 0.1 um at any distance.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "components/lidar_odometry/voxel_table.hpp"

namespace adit::lidar_odometry {

// What the 3x3x3 cells around a query hold.
struct Neighbourhood {
  bool found = false;
  float distance2 = 0.0f;                             // to the nearest point
  Eigen::Vector3d nearest = Eigen::Vector3d::Zero();  // map coordinates
};
struct NeighbourhoodStatistics : Neighbourhood {
  int count = 0;  // of all points in the 27 cells
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

class PointMap {
 public:
  // min_spacing: a point nearer than this to one already in its cell is not added; 0: no such test.
  PointMap(double voxel_size, std::size_t max_points_per_voxel, double min_spacing);

  // Nearest point within max_distance (<= voxel size is exact; beyond, only the 27 cells are searched, as published).
  Neighbourhood nearest(const Eigen::Vector3d& query, double max_distance) const;
  // The same, and count and covariance of all points of the 27 cells.
  NeighbourhoodStatistics statistics(const Eigen::Vector3d& query, double max_distance) const;

  void add(std::span<const Eigen::Vector3d> points);
  // Drops the cells whose first point is farther than radius from the centre.
  void remove_far(const Eigen::Vector3d& centre, double radius);
  void clear();
  bool empty() const { return table_.size() == 0; }
  std::size_t cells() const { return table_.size(); }
  bool overflowed() const { return overflowed_; }  // the map met its limit of cells and dropped points

 private:
  static constexpr std::size_t max_cells = 1u << 20;

  void grow();

  double voxel_size_;
  double inverse_size_;
  float min_spacing2_;
  std::uint32_t max_points_;
  VoxelTable table_;
  // Slot i of the pool: its cell, its count, and points_[i * max_points_ ...]. Slots are reused through free_.
  std::vector<VoxelKey> keys_;
  std::vector<std::uint32_t> counts_;  // 0: slot is free
  std::vector<Eigen::Vector3f> points_;
  std::vector<VoxelTable::Index> free_;
  bool overflowed_ = false;
};

}  // namespace adit::lidar_odometry
