// Hash table from the cells of a cubic grid to small integers: open addressing, linear probing, no tombstones (erase
// shifts back), one allocation. What a cell holds is the business of the caller, who keeps it in an array by index.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

namespace adit::lidar_odometry {

using Cell = Eigen::Vector3i;
using VoxelKey = std::uint64_t;

// 21 bits an axis. Precondition: within_grid(cell).
inline constexpr int grid_half_width = 1 << 20;
inline bool within_grid(const Cell& c) {
  return (c.array() >= -grid_half_width).all() && (c.array() < grid_half_width).all();
}
inline VoxelKey pack(const Cell& c) {
  const auto bits = [](int v) { return static_cast<VoxelKey>(v + grid_half_width); };
  return bits(c.x()) << 42 | bits(c.y()) << 21 | bits(c.z());
}
inline Cell unpack(VoxelKey key) {
  const auto value = [](VoxelKey v) { return static_cast<int>(v & 0x1FFFFF) - grid_half_width; };
  return {value(key >> 42), value(key >> 21), value(key)};
}
// Cells are half-open: floor, so that all have one size, also around zero. Precondition: |p * inverse_size| < 2^30.
template <class Vector>
Cell cell_of(const Vector& p, typename Vector::Scalar inverse_size) {
  return {static_cast<int>(std::floor(p.x() * inverse_size)), static_cast<int>(std::floor(p.y() * inverse_size)),
          static_cast<int>(std::floor(p.z() * inverse_size))};
}

class VoxelTable {
 public:
  using Index = std::uint32_t;
  static constexpr Index none = std::numeric_limits<Index>::max();

  // Makes room for `capacity` entries at a load of one half and forgets all entries.
  void reserve(std::size_t capacity);
  std::size_t size() const { return size_; }
  std::size_t capacity() const { return keys_.size() / 2; }
  void clear();

  Index find(VoxelKey key) const {
    for (std::size_t slot = home(key);; slot = (slot + 1) & mask_) {
      if (keys_[slot] == key) return values_[slot];
      if (keys_[slot] == empty_key) return none;
    }
  }
  // Precondition: the key is absent, size() < capacity().
  void insert(VoxelKey key, Index value);
  // Precondition: the key is present.
  void erase(VoxelKey key);

 private:
  static constexpr VoxelKey empty_key = std::numeric_limits<VoxelKey>::max();
  std::size_t home(VoxelKey key) const { return (key * 0x9E3779B97F4A7C15ull) >> shift_; }

  std::vector<VoxelKey> keys_ = std::vector<VoxelKey>(2, empty_key);
  std::vector<Index> values_ = std::vector<Index>(2, none);
  std::size_t size_ = 0;
  std::size_t mask_ = 1;
  int shift_ = 63;
};

// The set of cells already seen in this pass: first come, first served. Starting a pass costs nothing.
class VoxelFilter {
 public:
  // Room for `count` points in one pass.
  void begin(std::size_t count);
  // True the first time a cell is met in this pass.
  bool first(VoxelKey key) {
    for (std::size_t slot = (key * 0x9E3779B97F4A7C15ull) >> shift_;; slot = (slot + 1) & mask_) {
      if (epochs_[slot] != epoch_) {
        epochs_[slot] = epoch_;
        keys_[slot] = key;
        return true;
      }
      if (keys_[slot] == key) return false;
    }
  }

 private:
  std::vector<VoxelKey> keys_;
  std::vector<std::uint32_t> epochs_;
  std::uint32_t epoch_ = 0;
  std::size_t mask_ = 0;
  int shift_ = 63;
};

}  // namespace adit::lidar_odometry
