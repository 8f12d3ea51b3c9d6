#include "components/lidar_odometry/voxel_table.hpp"

#include <algorithm>
#include <bit>

namespace adit::lidar_odometry {

void VoxelTable::reserve(std::size_t capacity) {
  const std::size_t slots = std::bit_ceil(std::max<std::size_t>(2, 2 * capacity));
  keys_.assign(slots, empty_key);
  values_.assign(slots, none);
  mask_ = slots - 1;
  shift_ = 64 - std::countr_zero(slots);
  size_ = 0;
}

void VoxelTable::clear() {
  std::fill(keys_.begin(), keys_.end(), empty_key);
  size_ = 0;
}

void VoxelTable::insert(VoxelKey key, Index value) {
  std::size_t slot = home(key);
  while (keys_[slot] != empty_key) slot = (slot + 1) & mask_;
  keys_[slot] = key;
  values_[slot] = value;
  ++size_;
}

void VoxelTable::erase(VoxelKey key) {
  std::size_t hole = home(key);
  while (keys_[hole] != key) hole = (hole + 1) & mask_;
  for (std::size_t next = (hole + 1) & mask_; keys_[next] != empty_key; next = (next + 1) & mask_) {
    // An entry may move back into the hole unless its home lies cyclically after the hole.
    if (((next - home(keys_[next])) & mask_) >= ((next - hole) & mask_)) {
      keys_[hole] = keys_[next];
      values_[hole] = values_[next];
      hole = next;
    }
  }
  keys_[hole] = empty_key;
  --size_;
}

void VoxelFilter::begin(std::size_t count) {
  const std::size_t slots = std::bit_ceil(std::max<std::size_t>(2, 2 * count));
  if (slots > keys_.size()) {
    keys_.assign(slots, 0);
    epochs_.assign(slots, 0);
    epoch_ = 0;
    mask_ = slots - 1;
    shift_ = 64 - std::countr_zero(slots);
  }
  if (++epoch_ == 0) {  // wrapped: old marks would look new
    std::fill(epochs_.begin(), epochs_.end(), 0u);
    epoch_ = 1;
  }
}

}  // namespace adit::lidar_odometry
