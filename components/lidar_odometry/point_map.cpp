#include "components/lidar_odometry/point_map.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

namespace adit::lidar_odometry {
namespace {

// The 27 cells around a cell, nearer kinds first: itself, 6 by face, 12 by edge, 8 by corner.
std::array<Cell, 27> make_offsets() {
  std::array<Cell, 27> offsets;
  std::size_t n = 0;
  for (int kind = 0; kind <= 3; ++kind) {
    for (int x = -1; x <= 1; ++x) {
      for (int y = -1; y <= 1; ++y) {
        for (int z = -1; z <= 1; ++z) {
          if (std::abs(x) + std::abs(y) + std::abs(z) == kind) offsets[n++] = Cell(x, y, z);
        }
      }
    }
  }
  return offsets;
}

const std::array<Cell, 27> offsets = make_offsets();

bool block_within_grid(const Cell& cell) {
  return within_grid(cell - Cell::Ones()) && within_grid(cell + Cell::Ones());
}

}  // namespace

PointMap::PointMap(double voxel_size, std::size_t max_points_per_voxel, double min_spacing)
    : voxel_size_(voxel_size),
      inverse_size_(1.0 / voxel_size),
      min_spacing2_(static_cast<float>(min_spacing * min_spacing)),
      max_points_(static_cast<std::uint32_t>(max_points_per_voxel)) {
  grow();
}

void PointMap::grow() {
  const std::size_t capacity = std::max<std::size_t>(1u << 12, 2 * keys_.size());
  VoxelTable table;
  table.reserve(capacity);
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    if (counts_[i] > 0) table.insert(keys_[i], static_cast<VoxelTable::Index>(i));
  }
  free_.reserve(capacity);
  for (std::size_t i = capacity; i-- > keys_.size();) free_.push_back(static_cast<VoxelTable::Index>(i));
  keys_.resize(capacity);
  counts_.resize(capacity, 0);
  points_.resize(capacity * max_points_);
  table_ = std::move(table);
}

void PointMap::clear() {
  table_.clear();
  free_.clear();
  for (std::size_t i = keys_.size(); i-- > 0;) {
    counts_[i] = 0;
    free_.push_back(static_cast<VoxelTable::Index>(i));
  }
  overflowed_ = false;
}

Neighbourhood PointMap::nearest(const Eigen::Vector3d& query, double max_distance) const {
  Neighbourhood result;
  const Cell cell = cell_of(query, inverse_size_);
  if (!block_within_grid(cell)) return result;
  const auto size = static_cast<float>(voxel_size_);
  const Eigen::Vector3f q = (query - voxel_size_ * cell.cast<double>()).cast<float>();  // in [0, size)
  float best = static_cast<float>(max_distance * max_distance);
  for (const Cell& offset : offsets) {
    const Eigen::Vector3f local = q - size * offset.cast<float>();
    // Distance from the query to this cell's box: no point in it can be nearer.
    const Eigen::Vector3f outside = (-local).cwiseMax(local - Eigen::Vector3f::Constant(size)).cwiseMax(0.0f);
    if (outside.squaredNorm() > best) continue;
    const VoxelTable::Index slot = table_.find(pack(cell + offset));
    if (slot == VoxelTable::none) continue;
    const Eigen::Vector3f* points = &points_[static_cast<std::size_t>(slot) * max_points_];
    for (std::uint32_t i = 0; i < counts_[slot]; ++i) {
      const float distance2 = (points[i] - local).squaredNorm();
      if (distance2 < best) {
        best = distance2;
        result.found = true;
        result.distance2 = distance2;
        result.nearest = voxel_size_ * (cell + offset).cast<double>() + points[i].cast<double>();
      }
    }
  }
  return result;
}

NeighbourhoodStatistics PointMap::statistics(const Eigen::Vector3d& query, double max_distance) const {
  NeighbourhoodStatistics result;
  const Cell cell = cell_of(query, inverse_size_);
  if (!block_within_grid(cell)) return result;
  const Eigen::Vector3d origin = voxel_size_ * cell.cast<double>();
  const auto size = static_cast<float>(voxel_size_);
  const Eigen::Vector3f q = (query - origin).cast<float>();
  float best = static_cast<float>(max_distance * max_distance);
  Eigen::Vector3f nearest = Eigen::Vector3f::Zero();
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();  // about the query: small numbers, no cancellation
  Eigen::Matrix3f sum2 = Eigen::Matrix3f::Zero();
  for (const Cell& offset : offsets) {
    const VoxelTable::Index slot = table_.find(pack(cell + offset));
    if (slot == VoxelTable::none) continue;
    const Eigen::Vector3f local = q - size * offset.cast<float>();
    const Eigen::Vector3f* points = &points_[static_cast<std::size_t>(slot) * max_points_];
    for (std::uint32_t i = 0; i < counts_[slot]; ++i) {
      const Eigen::Vector3f d = points[i] - local;
      const float distance2 = d.squaredNorm();
      if (distance2 < best) {
        best = distance2;
        result.found = true;
        nearest = d;
      }
      ++result.count;
      sum += d;
      sum2.noalias() += d * d.transpose();
    }
  }
  result.distance2 = best;
  result.nearest = query + nearest.cast<double>();
  if (result.count > 0) {
    const Eigen::Vector3d mean = sum.cast<double>() / result.count;
    result.covariance = sum2.cast<double>() / result.count - mean * mean.transpose();
  }
  return result;
}

void PointMap::add(std::span<const Eigen::Vector3d> points) {
  for (const Eigen::Vector3d& point : points) {
    const Cell cell = cell_of(point, inverse_size_);
    if (!block_within_grid(cell)) continue;
    const VoxelKey key = pack(cell);
    const Eigen::Vector3f local = (point - voxel_size_ * cell.cast<double>()).cast<float>();
    VoxelTable::Index slot = table_.find(key);
    if (slot == VoxelTable::none) {
      if (free_.empty()) {
        if (keys_.size() >= max_cells) {
          overflowed_ = true;
          continue;
        }
        grow();
      }
      slot = free_.back();
      free_.pop_back();
      table_.insert(key, slot);
      keys_[slot] = key;
    }
    std::uint32_t& count = counts_[slot];
    Eigen::Vector3f* stored = &points_[static_cast<std::size_t>(slot) * max_points_];
    const bool crowded = min_spacing2_ > 0.0f && std::any_of(stored, stored + count, [&](const Eigen::Vector3f& p) {
                           return (p - local).squaredNorm() < min_spacing2_;
                         });
    if (count < max_points_ && !crowded) stored[count++] = local;
  }
}

void PointMap::remove_far(const Eigen::Vector3d& centre, double radius) {
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    if (counts_[i] == 0) continue;
    const Eigen::Vector3d first =
        voxel_size_ * unpack(keys_[i]).cast<double>() + points_[i * max_points_].cast<double>();
    if ((first - centre).squaredNorm() <= radius * radius) continue;
    table_.erase(keys_[i]);
    counts_[i] = 0;
    free_.push_back(static_cast<VoxelTable::Index>(i));
  }
}

}  // namespace adit::lidar_odometry
