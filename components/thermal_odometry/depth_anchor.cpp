#include "components/thermal_odometry/depth_anchor.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace adit::thermal_odometry {
namespace {
constexpr int cell_size = 8;  // px
}

DepthAnchor::DepthAnchor(const Pinhole& camera, int width, int height, std::size_t capacity, const Config& config)
    : camera_(camera), width_(width), height_(height), capacity_(capacity), config_(config) {
  columns_ = (width + cell_size - 1) / cell_size;
  rows_ = (height + cell_size - 1) / cell_size;
  projected_.reserve(capacity);
  sorted_.reserve(capacity);
  first_.assign(static_cast<std::size_t>(columns_ * rows_) + 1, 0);
  nearest_.assign(static_cast<std::size_t>(columns_ * rows_), 0.0F);
}

void DepthAnchor::project(std::span<const Eigen::Vector3f> points, const Vector6d& rate) {
  projected_.clear();
  const auto fx = static_cast<float>(camera_.fx);
  const auto fy = static_cast<float>(camera_.fy);
  const auto cx = static_cast<float>(camera_.cx);
  const auto cy = static_cast<float>(camera_.cy);
  const bool rolling = camera_.row_time != 0.0;
  const auto row_time = static_cast<float>(camera_.row_time);
  const auto middle_row = static_cast<float>(camera_.middle_row);
  const Eigen::Vector3f velocity = rate.head<3>().cast<float>();
  const Eigen::Vector3f spin = rate.tail<3>().cast<float>();
  for (Eigen::Vector3f point : points) {
    if (rolling && point.z() > 0.5F * config_.min_range) {
      const float row = fy * point.y() / point.z() + cy;
      if (std::abs(row - middle_row) < static_cast<float>(height_)) {
        point += row_time * (row - middle_row) * (spin.cross(point) + velocity);
      }
    }
    if (!(point.z() > config_.min_range) || !(point.z() < config_.max_range)) continue;
    const float inverse = 1.0F / point.z();
    const float u = fx * point.x() * inverse + cx;
    const float v = fy * point.y() * inverse + cy;
    if (!(u >= 0.0F && v >= 0.0F && u < static_cast<float>(width_ - 1) && v < static_cast<float>(height_ - 1)))
      continue;
    if (projected_.size() == capacity_) break;
    const int cell = static_cast<int>(v) / cell_size * columns_ + static_cast<int>(u) / cell_size;
    projected_.push_back({u, v, inverse, cell});
  }
  remove_hidden();
  std::fill(first_.begin(), first_.end(), 0);
  for (const Projection& p : projected_) ++first_[static_cast<std::size_t>(p.cell) + 1];
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  sorted_.resize(projected_.size());
  for (const Projection& p : projected_) {  // first_ holds the write position of each cell, shifted back below
    sorted_[static_cast<std::size_t>(first_[static_cast<std::size_t>(p.cell)]++)] = p;
  }
  for (std::size_t i = first_.size() - 1; i > 0; --i) first_[i] = first_[i - 1];
  first_[0] = 0;
}

// The LiDAR looks past edges the camera does not: a point is kept only if nothing in the 3 x 3 cells around it is much
// nearer.
void DepthAnchor::remove_hidden() {
  std::fill(nearest_.begin(), nearest_.end(), 0.0F);
  for (const Projection& p : projected_) {
    float& nearest = nearest_[static_cast<std::size_t>(p.cell)];
    nearest = std::max(nearest, p.inverse_depth);
  }
  const auto hidden = [this](const Projection& p) {
    const int column = p.cell % columns_;
    const int row = p.cell / columns_;
    float near = p.inverse_depth;
    for (int r = std::max(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r) {
      for (int c = std::max(0, column - 1); c <= std::min(columns_ - 1, column + 1); ++c) {
        near = std::max(near, nearest_[static_cast<std::size_t>(r * columns_ + c)]);
      }
    }
    return 1.0F / p.inverse_depth > 1.3F / near + 0.3F;
  };
  projected_.erase(std::remove_if(projected_.begin(), projected_.end(), hidden), projected_.end());
}

std::optional<AnchorDepth> DepthAnchor::depth_at(float u, float v) const {
  const float r = config_.radius;
  const int c0 = std::max(0, static_cast<int>(u - r) / cell_size);
  const int c1 = std::min(columns_ - 1, static_cast<int>(u + r) / cell_size);
  const int r0 = std::max(0, static_cast<int>(v - r) / cell_size);
  const int r1 = std::min(rows_ - 1, static_cast<int>(v + r) / cell_size);
  Eigen::Matrix3f H = Eigen::Matrix3f::Zero();
  Eigen::Vector3f b = Eigen::Vector3f::Zero();
  float sum_d2 = 0.0F;
  float low = 1e9F;
  float high = 0.0F;
  int n = 0;
  for (int row = r0; row <= r1; ++row) {
    const std::int32_t begin = first_[static_cast<std::size_t>(row * columns_ + c0)];
    const std::int32_t end = first_[static_cast<std::size_t>(row * columns_ + c1 + 1)];
    for (std::int32_t i = begin; i < end; ++i) {
      const Projection& p = sorted_[static_cast<std::size_t>(i)];
      const float du = p.u - u;
      const float dv = p.v - v;
      if (du * du + dv * dv > r * r) continue;
      const Eigen::Vector3f a(1.0F, du, dv);
      H.noalias() += a * a.transpose();
      b += a * p.inverse_depth;
      sum_d2 += p.inverse_depth * p.inverse_depth;
      low = std::min(low, p.inverse_depth);
      high = std::max(high, p.inverse_depth);
      ++n;
    }
  }
  if (n < config_.min_points) return std::nullopt;
  Eigen::Matrix3f ridged = H;
  ridged(1, 1) += 0.05F * H(0, 0);
  ridged(2, 2) += 0.05F * H(0, 0);
  const Eigen::Vector3f x = ridged.ldlt().solve(b);
  const float d = x[0];
  if (!x.allFinite() || d < 0.8F * low || d > 1.25F * high) return std::nullopt;
  const float squared = std::max(0.0F, sum_d2 - 2.0F * b.dot(x) + x.dot(H * x)) / static_cast<float>(n);
  if (squared > config_.max_residual * config_.max_residual * d * d) return std::nullopt;
  const float range = config_.range_sigma * d * d;
  const float relative = config_.relative_sigma * d;
  return AnchorDepth{d, x[1], x[2], std::sqrt(squared + range * range + relative * relative)};
}

}  // namespace adit::thermal_odometry
