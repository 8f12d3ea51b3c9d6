#include "components/mapping/voxel_grid.hpp"

#include <algorithm>
#include <cmath>

namespace adit::mapping {

std::uint64_t voxel_key(int x, int y, int z) {
  constexpr std::uint64_t mask = (1U << 21U) - 1U;
  const auto part = [](int v) { return static_cast<std::uint64_t>(static_cast<std::uint32_t>(v)) & mask; };
  return part(x) | (part(y) << 21U) | (part(z) << 42U);
}

std::uint64_t voxel_key(const Eigen::Vector3f& position, float inverse_size) {
  const Eigen::Vector3f cell = (position * inverse_size).array().floor();
  return voxel_key(static_cast<int>(cell.x()), static_cast<int>(cell.y()), static_cast<int>(cell.z()));
}

void VoxelGrid::insert(const Point& point) {
  const std::uint64_t key = voxel_key(point.position, inverse_size_);
  const auto [entry, is_new] = index_.try_emplace(key, static_cast<std::uint32_t>(voxels_.size()));
  if (is_new) {
    Voxel voxel;
    voxel.key = key;
    voxel.origin = point.position;
    voxels_.push_back(voxel);
  }
  Voxel& voxel = voxels_[entry->second];
  voxel.sum += point.position - voxel.origin;
  voxel.intensity += point.intensity;
  voxel.count += 1.0F;
}

void VoxelGrid::keep_within(const Eigen::Vector3f& centre, float radius) {
  std::erase_if(voxels_, [&](const Voxel& v) { return (v.origin - centre).squaredNorm() > radius * radius; });
  index_.clear();
  for (std::size_t i = 0; i < voxels_.size(); ++i) index_.emplace(voxels_[i].key, static_cast<std::uint32_t>(i));
}

void VoxelGrid::clear() {
  voxels_.clear();
  index_.clear();
}

Points VoxelGrid::points() const {
  Points out;
  out.reserve(voxels_.size());
  for (const Voxel& voxel : voxels_) out.push_back({voxel.mean(), voxel.intensity / voxel.count});
  return out;
}

}  // namespace adit::mapping
