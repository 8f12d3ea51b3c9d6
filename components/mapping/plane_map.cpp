#include "components/mapping/plane_map.hpp"

#include <array>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "components/mapping/voxel_grid.hpp"

namespace adit::mapping {
namespace {

constexpr int least_points = 5;
// Flat: at most this part of the variance lies along the normal, and the second direction has this part of the first
// (a line of points has no normal).
constexpr float flat_share = 0.08F;
constexpr float line_share = 0.05F;

struct Moments {
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  Eigen::Matrix3f squares = Eigen::Matrix3f::Zero();
  int count = 0;
};

std::optional<Plane> plane_of(const Moments& m) {
  if (m.count < least_points) return std::nullopt;
  const auto n = static_cast<float>(m.count);
  const Eigen::Vector3f mean = m.sum / n;
  const Eigen::Matrix3f covariance = m.squares / n - mean * mean.transpose();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver;
  solver.computeDirect(covariance);
  const Eigen::Vector3f l = solver.eigenvalues().cwiseMax(1e-8F);
  if (!(l[0] < flat_share * l.sum()) || !(l[1] > line_share * l[2])) return std::nullopt;
  Plane plane;
  plane.mean = m.origin + mean;
  plane.normal = solver.eigenvectors().col(0);
  plane.thickness2 = l[0];
  plane.normal_variance = l[0] / (n * l[1]);
  return plane;
}

}  // namespace

PlaneMap::PlaneMap(std::span<const Point> points, double size) : size_(static_cast<float>(size)) {
  std::unordered_map<std::uint64_t, std::uint32_t> cells;
  std::vector<std::pair<std::uint64_t, Moments>> moments;
  for (const Point& point : points) {
    const std::uint64_t key = voxel_key(point.position, 1.0F / size_);
    const auto [entry, is_new] = cells.try_emplace(key, static_cast<std::uint32_t>(moments.size()));
    if (is_new) {
      moments.emplace_back(key, Moments{});
      moments.back().second.origin = point.position;
    }
    Moments& m = moments[entry->second].second;
    const Eigen::Vector3f offset = point.position - m.origin;
    m.sum += offset;
    m.squares += offset * offset.transpose();
    ++m.count;
  }
  for (const auto& [key, m] : moments) {
    if (const std::optional<Plane> plane = plane_of(m)) {
      index_.emplace(key, static_cast<std::uint32_t>(planes_.size()));
      planes_.push_back(*plane);
    }
  }
}

const Plane* PlaneMap::nearest(const Eigen::Vector3f& position) const {
  const Eigen::Vector3f scaled = position / size_;
  const Eigen::Array3i cell = scaled.array().floor().cast<int>();
  // Its own voxel and, in each axis, the one on the nearer side.
  const Eigen::Array3i side = (scaled.array() - cell.cast<float>() < 0.5F).select(Eigen::Array3i::Constant(-1), 1);
  const Plane* best = nullptr;
  float best_distance2 = 4.0F * size_ * size_;
  for (int corner = 0; corner < 8; ++corner) {
    const auto entry =
        index_.find(voxel_key(cell.x() + (corner & 1 ? side.x() : 0), cell.y() + (corner & 2 ? side.y() : 0),
                              cell.z() + (corner & 4 ? side.z() : 0)));
    if (entry == index_.end()) continue;
    const Plane& plane = planes_[entry->second];
    const float distance2 = (plane.mean - position).squaredNorm();
    if (distance2 < best_distance2) {
      best = &plane;
      best_distance2 = distance2;
    }
  }
  return best;
}

}  // namespace adit::mapping
