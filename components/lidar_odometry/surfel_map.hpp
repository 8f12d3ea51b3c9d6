// The local map of mode default: a sparse grid of cells, each with the running moments of the surfels that fell into it
// and the plane they make. All memory is taken at construction.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "components/lidar_odometry/voxel_table.hpp"

namespace adit::lidar_odometry {

// A surfel in map coordinates.
struct MapSurfel {
  Eigen::Vector3d point;
  Eigen::Vector3f normal;
};

class SurfelMap {
 public:
  using Index = VoxelTable::Index;
  static constexpr Index none = VoxelTable::none;

  // The surface of a cell, relative to the cell's centre. For a point q and e = q - mean, the mean over the cell's
  // surfels of their normal distance to q is normal . e - offset: offset holds the curvature.
  struct Plane {
    Eigen::Vector3f mean;
    float offset = 0.0f;     // m
    Eigen::Vector3f normal;  // unit
    float variance = -1.0f;  // m^2, of the mean along the normal; negative: the cell has no plane
  };

  SurfelMap(double cell_size, double radius, std::size_t capacity);

  // The cell at a point, or none. Points beyond the grid are in no cell.
  Index find(const Cell& cell) const { return table_.find(pack(cell)); }
  Cell cell_at(const Eigen::Vector3d& point) const { return cell_of(point, inverse_size_); }
  const Plane& plane(Index index) const { return planes_[index]; }
  Eigen::Vector3d centre(const Cell& cell) const {
    return cell_size_ * (cell.cast<double>() + Eigen::Vector3d::Constant(0.5));
  }
  double cell_size() const { return cell_size_; }

  // Adds surfels seen from `sensor`, then drops some of the cells beyond the radius (all of them within 32 calls).
  void add(std::span<const MapSurfel> surfels, const Eigen::Vector3d& sensor);
  void clear();
  bool empty() const { return table_.size() == 0; }
  std::size_t cells() const { return table_.size(); }
  std::size_t evicted() const { return evicted_; }  // by the last add, because the map was full

 private:
  // Sums relative to the cell's centre.
  struct Moments {
    VoxelKey key = 0;
    std::uint32_t last_seen = 0;
    float count = 0.0f;  // 0: the slot is free
    Eigen::Vector3f point = Eigen::Vector3f::Zero();
    float squares[6] = {};  // xx xy xz yy yz zz
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    float normal_point = 0.0f;  // sum of n . p
  };
  Index allocate();
  void release(Index index);
  void update_plane(Index index);

  double cell_size_, inverse_size_, radius_;
  VoxelTable table_;
  std::vector<Moments> moments_;
  std::vector<Plane> planes_;
  std::vector<Index> free_;
  std::vector<Index> touched_;
  std::uint32_t scan_ = 0;
  std::size_t sweep_hand_ = 0, eviction_hand_ = 0;
  std::size_t evicted_ = 0;
};

}  // namespace adit::lidar_odometry
