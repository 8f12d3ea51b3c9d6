#include "components/lidar_odometry/surfel_map.hpp"

#include <algorithm>
#include <cmath>

namespace adit::lidar_odometry {
namespace {

constexpr float min_count = 1.0f;
constexpr float usual_variance = 1e-4f;  // m^2
constexpr float max_count = 100.0f;      // then older surfels fade
constexpr float min_alignment = 0.98f;   // |sum n| / count: else the cell holds an edge
constexpr std::size_t sweep_parts = 32;
constexpr std::size_t eviction_candidates = 64;

}  // namespace

SurfelMap::SurfelMap(double cell_size, double radius, std::size_t capacity)
    : cell_size_(cell_size), inverse_size_(1.0 / cell_size), radius_(radius) {
  table_.reserve(capacity);
  moments_.resize(capacity);
  planes_.resize(capacity);
  free_.reserve(capacity);
  touched_.reserve(capacity);
  clear();
}

void SurfelMap::clear() {
  table_.clear();
  free_.clear();
  for (std::size_t i = moments_.size(); i-- > 0;) {
    moments_[i].count = 0.0f;
    free_.push_back(static_cast<Index>(i));
  }
  scan_ = 0;
  sweep_hand_ = eviction_hand_ = evicted_ = 0;
}

void SurfelMap::release(Index index) {
  table_.erase(moments_[index].key);
  moments_[index].count = 0.0f;
  planes_[index].variance = -1.0f;
  free_.push_back(index);
}

SurfelMap::Index SurfelMap::allocate() {
  if (free_.empty()) {
    // The longest unseen of the next few cells makes room; cells of this scan stay.
    Index oldest = none;
    for (std::size_t i = 0; i < eviction_candidates; ++i) {
      const auto candidate = static_cast<Index>(eviction_hand_);
      eviction_hand_ = (eviction_hand_ + 1) % moments_.size();
      if (moments_[candidate].last_seen == scan_) continue;
      if (oldest == none || moments_[candidate].last_seen < moments_[oldest].last_seen) oldest = candidate;
    }
    ++evicted_;
    if (oldest == none) return none;
    release(oldest);
  }
  const Index index = free_.back();
  free_.pop_back();
  return index;
}

void SurfelMap::add(std::span<const MapSurfel> surfels, const Eigen::Vector3d& sensor) {
  ++scan_;
  evicted_ = 0;
  touched_.clear();
  for (const MapSurfel& surfel : surfels) {
    const Cell cell = cell_at(surfel.point);
    // The neighbours of a stored cell must be within the grid, too.
    if (!within_grid(cell - Cell::Ones()) || !within_grid(cell + Cell::Ones())) continue;
    const VoxelKey key = pack(cell);
    Index index = table_.find(key);
    if (index == none) {
      index = allocate();
      if (index == none) continue;
      table_.insert(key, index);
      moments_[index] = Moments{};
      moments_[index].key = key;
    }
    Moments& m = moments_[index];
    if (m.last_seen != scan_) touched_.push_back(index);
    m.last_seen = scan_;
    if (m.count >= max_count) {
      m.count *= 0.5f;
      m.point *= 0.5f;
      for (float& square : m.squares) square *= 0.5f;
      m.normal *= 0.5f;
      m.normal_point *= 0.5f;
    }
    const Eigen::Vector3f p = (surfel.point - centre(cell)).cast<float>();
    m.count += 1.0f;
    m.point += p;
    m.squares[0] += p.x() * p.x();
    m.squares[1] += p.x() * p.y();
    m.squares[2] += p.x() * p.z();
    m.squares[3] += p.y() * p.y();
    m.squares[4] += p.y() * p.z();
    m.squares[5] += p.z() * p.z();
    m.normal += surfel.normal;
    m.normal_point += surfel.normal.dot(p);
  }
  for (const Index index : touched_) update_plane(index);

  const std::size_t part = (moments_.size() + sweep_parts - 1) / sweep_parts;
  const std::size_t end = std::min(sweep_hand_ + part, moments_.size());
  for (std::size_t i = sweep_hand_; i < end; ++i) {
    if (moments_[i].count > 0.0f && (centre(unpack(moments_[i].key)) - sensor).squaredNorm() > radius_ * radius_) {
      release(static_cast<Index>(i));
    }
  }
  sweep_hand_ = end == moments_.size() ? 0 : end;
}

void SurfelMap::update_plane(Index index) {
  const Moments& m = moments_[index];
  Plane& plane = planes_[index];
  plane.variance = -1.0f;
  const float length = m.normal.norm();
  if (m.count < min_count || length < min_alignment * m.count) return;
  plane.mean = m.point / m.count;
  plane.normal = m.normal / length;
  plane.offset = (m.normal_point - m.normal.dot(plane.mean)) / length;
  const Eigen::Vector3f& n = plane.normal;
  const float along = n.dot(plane.mean);
  const float square = n.x() * (n.x() * m.squares[0] + 2.0f * n.y() * m.squares[1] + 2.0f * n.z() * m.squares[2]) +
                       n.y() * (n.y() * m.squares[3] + 2.0f * n.z() * m.squares[4]) + n.z() * n.z() * m.squares[5];
  // The spread about the plane, from so few samples with two more of a usual one.
  const float spread = (std::max(square - m.count * along * along, 0.0f) + 2.0f * usual_variance) / (m.count + 2.0f);
  plane.variance = spread / m.count;
}

}  // namespace adit::lidar_odometry
