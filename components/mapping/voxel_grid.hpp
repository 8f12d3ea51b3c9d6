// Points thinned to one a voxel: the mean of what fell into it.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "components/mapping/cloud.hpp"

namespace adit::mapping {

// Cell indices of 21 bits each in one word. Coordinates beyond +-2^20 cells wrap.
std::uint64_t voxel_key(const Eigen::Vector3f& position, float inverse_size);
std::uint64_t voxel_key(int x, int y, int z);

class VoxelGrid {
 public:
  // `size`: edge of a voxel [m], positive.
  explicit VoxelGrid(double size) : inverse_size_(static_cast<float>(1.0 / size)) {}

  // Precondition: finite.
  void insert(const Point& point);
  void insert(std::span<const Point> points) {
    for (const Point& point : points) insert(point);
  }
  // Forgets what is farther from the centre [m].
  void keep_within(const Eigen::Vector3f& centre, float radius);
  void clear();

  // Means, in the order in which their voxels were first hit.
  Points points() const;
  std::size_t size() const { return voxels_.size(); }

 private:
  struct Voxel {
    std::uint64_t key = 0;
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();  // of offsets from `origin`: exact far from zero
    Eigen::Vector3f origin = Eigen::Vector3f::Zero();
    float intensity = 0.0F;
    float count = 0.0F;
    Eigen::Vector3f mean() const { return origin + sum / count; }
  };
  float inverse_size_;
  std::vector<Voxel> voxels_;
  std::unordered_map<std::uint64_t, std::uint32_t> index_;
};

}  // namespace adit::mapping
