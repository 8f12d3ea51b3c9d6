#include "components/lidar_odometry/surfel.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "components/lidar_odometry/sweep.hpp"

namespace adit::lidar_odometry {
namespace {

// Pixels of a block: about 1.4 x 0.7 degrees for a LiDAR that looks around.
std::size_t automatic_columns(std::size_t width) {
  return std::clamp<std::size_t>((width + 128) / 256, 2, 8);
}
std::size_t automatic_rows(std::size_t height) {
  return std::clamp<std::size_t>(height / 64, 1, 4);
}

}  // namespace

void SurfelExtractor::make_blocks(const Cloud& image, std::size_t block_row) {
  const auto min2 = static_cast<float>(config_.min_range * config_.min_range);
  const auto max2 = static_cast<float>(config_.max_range * config_.max_range);
  const std::size_t row_begin = block_row * block_rows_;
  const std::size_t row_end = std::min(row_begin + block_rows_, image.height);
  const auto half = static_cast<float>(block_columns_ * block_rows_) * 0.5f;
  RowCounters counters{0, 0};
  for (std::size_t b = 0; b < columns_; ++b) {
    Block& block = blocks_[block_row * columns_ + b];
    const std::size_t column_begin = b * block_columns_;
    const std::size_t column_end = std::min(column_begin + block_columns_, image.width);
    // Moments about the first point: small numbers.
    Eigen::Vector3f origin = Eigen::Vector3f::Zero();
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    float xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, count = 0;
    float near2 = max2;
    float far2 = 0.0f;
    for (std::size_t r = row_begin; r < row_end; ++r) {
      for (std::size_t c = column_begin; c < column_end; ++c) {
        const Point3f p = image.points[r * image.width + c];
        const float range2 = p.squaredNorm();
        if (!(range2 > min2 && range2 < max2)) {
          if (range2 > 0.0f && std::isfinite(range2)) {
            ++counters.out_of_range;
          } else {
            ++counters.invalid;
          }
          continue;
        }
        near2 = std::min(near2, range2);
        far2 = std::max(far2, range2);
        if (count == 0.0f) origin = p;
        const Eigen::Vector3f d = p - origin;
        sum += d;
        xx += d.x() * d.x();
        xy += d.x() * d.y();
        xz += d.x() * d.z();
        yy += d.y() * d.y();
        yz += d.y() * d.z();
        zz += d.z() * d.z();
        count += 1.0f;
      }
    }
    block.count = 0.0f;
    if (count < half) continue;
    const float range = std::sqrt(near2);
    if (std::sqrt(far2) - range > 0.15f + 0.08f * range) continue;
    const Eigen::Vector3f m = sum / count;
    block.mean = origin + m;
    block.range = block.mean.norm();
    block.count = count;
    const float scatter[6] = {xx - count * m.x() * m.x(), xy - count * m.x() * m.y(), xz - count * m.x() * m.z(),
                              yy - count * m.y() * m.y(), yz - count * m.y() * m.z(), zz - count * m.z() * m.z()};
    std::copy(std::begin(scatter), std::end(scatter), std::begin(block.scatter));
  }
  row_counters_[block_row] = counters;
}

bool SurfelExtractor::make_surfel(const Cloud& image, std::size_t row, std::size_t column, Surfel& surfel) const {
  const Block& centre = blocks_[row * columns_ + column];
  const float reach = 0.1f + 0.1f * centre.range;
  // Joint moments of the 3 x 3 blocks that continue the surface, about the centre's mean.
  float count = 0.0f;
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  float s[6] = {};
  const std::size_t row_end = std::min(row + 2, rows_);
  const std::size_t column_end = std::min(column + 2, columns_);
  for (std::size_t r = row > 0 ? row - 1 : 0; r < row_end; ++r) {
    for (std::size_t c = column > 0 ? column - 1 : 0; c < column_end; ++c) {
      const Block& block = blocks_[r * columns_ + c];
      if (block.count == 0.0f || !(std::abs(block.range - centre.range) < reach)) continue;
      const Eigen::Vector3f d = block.mean - centre.mean;
      count += block.count;
      sum += block.count * d;
      s[0] += block.scatter[0] + block.count * d.x() * d.x();
      s[1] += block.scatter[1] + block.count * d.x() * d.y();
      s[2] += block.scatter[2] + block.count * d.x() * d.z();
      s[3] += block.scatter[3] + block.count * d.y() * d.y();
      s[4] += block.scatter[4] + block.count * d.y() * d.z();
      s[5] += block.scatter[5] + block.count * d.z() * d.z();
    }
  }
  const Eigen::Vector3d m = (sum / count).cast<double>();
  Eigen::Matrix3d covariance;
  covariance << s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5];
  covariance /= static_cast<double>(count);
  const Eigen::Vector3d beam = centre.mean.cast<double>() / static_cast<double>(centre.range);
  const double noise = config_.surfel.range_sigma * config_.surfel.range_sigma;
  covariance -= m * m.transpose() + noise * beam * beam.transpose();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(covariance);
  const Eigen::Vector3d& l = eigen.eigenvalues();  // ascending
  const SurfelConfig& c = config_.surfel;
  // Not a line of one ring, not an edge, not a mixture.
  if (!(l[2] < c.max_extent * c.max_extent && l[1] > c.min_width * c.min_width && l[0] < c.planarity * l[1] &&
        l[0] < c.max_thickness * c.max_thickness)) {
    return false;
  }
  surfel.point = centre.mean;
  surfel.normal = eigen.eigenvectors().col(0).cast<float>();
  if (surfel.normal.dot(surfel.point) > 0.0f) surfel.normal = -surfel.normal;
  if (!surfel.normal.allFinite()) return false;
  surfel.cluster =
      static_cast<std::uint16_t>(row * cluster_rows / rows_ * cluster_columns + column * cluster_columns / columns_);
  surfel.time = 0.0f;
  if (!image.seconds.empty() || !image.nanoseconds.empty()) {
    const std::size_t r = std::min(row * block_rows_ + block_rows_ / 2, image.height - 1);
    const std::size_t first = column * block_columns_;
    const std::size_t last = std::min(first + block_columns_, image.width) - 1;
    surfel.time = static_cast<float>(
        0.5 * (point_time(image, r * image.width + first) + point_time(image, r * image.width + last)));
  }
  return true;
}

void SurfelExtractor::extract(const Cloud& image, WorkerPool& pool, std::vector<Surfel>& surfels,
                              ScanCounters& counters) {
  const SurfelConfig& c = config_.surfel;
  block_columns_ = c.block_columns > 0 ? c.block_columns : automatic_columns(image.width);
  block_rows_ = c.block_rows > 0 ? c.block_rows : automatic_rows(image.height);
  columns_ = (image.width + block_columns_ - 1) / block_columns_;
  rows_ = (image.height + block_rows_ - 1) / block_rows_;
  blocks_.resize(columns_ * rows_);
  row_counters_.resize(rows_);
  pool.run(rows_, [&](std::size_t row) { make_blocks(image, row); });
  for (const RowCounters& row : row_counters_) {
    counters.invalid += row.invalid;
    counters.out_of_range += row.out_of_range;
  }

  // The first block of each cell; in narrow places, or with few rings, of each smaller cell.
  double cell = c.selection_cell;
  for (int halving = 0; halving < 3; ++halving, cell *= 0.5) {
    selected_.clear();
    filter_.begin(blocks_.size());
    const auto inverse_cell = static_cast<float>(1.0 / cell);
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      if (blocks_[i].count > 0.0f && filter_.first(pack(cell_of(blocks_[i].mean, inverse_cell)))) {
        selected_.push_back(static_cast<std::uint32_t>(i));
      }
    }
    if (selected_.size() >= c.min_surfels) break;
  }

  constexpr std::size_t chunk = 256;
  candidates_.resize(selected_.size());
  kept_.resize(selected_.size());
  pool.run((selected_.size() + chunk - 1) / chunk, [&](std::size_t k) {
    const std::size_t end = std::min((k + 1) * chunk, selected_.size());
    for (std::size_t i = k * chunk; i < end; ++i) {
      kept_[i] = make_surfel(image, selected_[i] / columns_, selected_[i] % columns_, candidates_[i]);
    }
  });
  surfels.clear();
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    if (kept_[i] != 0) surfels.push_back(candidates_[i]);
  }
}

}  // namespace adit::lidar_odometry
