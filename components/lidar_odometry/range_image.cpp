#include "components/lidar_odometry/range_image.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "components/lidar_odometry/sweep.hpp"

namespace adit::lidar_odometry {
namespace {

constexpr std::uint16_t no_row = std::numeric_limits<std::uint16_t>::max();
constexpr std::size_t max_rows = 256;
constexpr std::size_t min_columns = 128;
constexpr std::size_t max_columns = 2048;
constexpr std::size_t fallback_rows = 64;
constexpr float pi = std::numbers::pi_v<float>;

bool usable(const Point3f& p) {
  return p.allFinite() && !p.isZero(0.0f) && p.cwiseAbs().maxCoeff() < 1e6f;
}
float elevation(const Point3f& p) {
  return std::atan2(p.z(), std::hypot(p.x(), p.y()));
}

}  // namespace

// Rows from the top down, by a histogram of the elevations in steps of 0.05 degrees.
std::size_t RangeImage::rows_from_elevation(const Cloud& cloud) {
  constexpr std::size_t bins = 3600;
  const auto bin = [](const Point3f& p) {
    const float fraction = 0.5f - elevation(p) / pi;
    return std::min(static_cast<std::size_t>(fraction * static_cast<float>(bins)), bins - 1);
  };
  counts_.assign(bins, 0);
  std::uint32_t total = 0;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Point3f p = cloud.points[i];
    if (!usable(p)) continue;
    ++counts_[bin(p)];
    ++total;
  }
  // Rings show as short runs of bins with gaps between them.
  row_of_bin_.assign(bins, no_row);
  const std::uint32_t noise = total / 20000;
  std::size_t runs = 0;
  std::size_t filled = 0;
  for (std::size_t i = 0; i < bins; ++i) {
    if (counts_[i] <= noise) continue;
    if (i == 0 || counts_[i - 1] <= noise) ++runs;
    ++filled;
    row_of_bin_[i] = static_cast<std::uint16_t>(runs - 1);
  }
  if (runs < 4 || runs > max_rows || filled > 4 * runs) {
    std::size_t low = 0;
    std::size_t high = bins - 1;
    const std::uint32_t tail = total / 200;
    for (std::uint32_t sum = 0; low < high && (sum += counts_[low]) <= tail; ++low) {
    }
    for (std::uint32_t sum = 0; high > low && (sum += counts_[high]) <= tail; --high) {
    }
    runs = fallback_rows;
    for (std::size_t i = 0; i < bins; ++i) {
      const bool inside = i >= low && i <= high;
      row_of_bin_[i] = inside ? static_cast<std::uint16_t>((i - low) * runs / (high - low + 1)) : no_row;
    }
  }
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Point3f p = cloud.points[i];
    rows_[i] = usable(p) ? row_of_bin_[bin(p)] : no_row;
  }
  return runs;
}

std::size_t RangeImage::assign_rows(const Cloud& cloud) {
  rows_.resize(cloud.points.size());
  if (cloud.rings.empty()) return rows_from_elevation(cloud);
  std::size_t count = 0;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const std::uint16_t ring = cloud.rings[i];
    rows_[i] = ring < max_rows && usable(cloud.points[i]) ? ring : no_row;
    if (rows_[i] != no_row) count = std::max<std::size_t>(count, rows_[i] + 1u);
  }
  return count;
}

Cloud RangeImage::organise(const Cloud& cloud) {
  if (cloud.height > 1) return cloud;
  const std::size_t rows = assign_rows(cloud);
  const bool times = !cloud.seconds.empty() || !cloud.nanoseconds.empty();

  counts_.assign(rows + 1, 0);
  for (const std::uint16_t row : rows_) counts_[row == no_row ? rows : row] += 1;
  counts_.back() = 0;
  const std::size_t longest = *std::max_element(counts_.begin(), counts_.end());
  const std::size_t columns = std::clamp((longest + 3) / 4 * 4, min_columns, max_columns);

  float start = pi;
  double earliest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < cloud.points.size() && times; ++i) {
    if (rows_[i] == no_row || point_time(cloud, i) >= earliest) continue;
    earliest = point_time(cloud, i);
    start = std::atan2(cloud.points[i].y(), cloud.points[i].x());
  }

  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  points_.assign(rows * columns, Point3f(nan, nan, nan));
  seconds_.assign(times ? rows * columns : 0, 0.0f);
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    if (rows_[i] == no_row) continue;
    const Point3f p = cloud.points[i];
    float turn = (start - std::atan2(p.y(), p.x())) / (2.0f * pi);
    turn -= std::floor(turn);
    const std::size_t column = std::min(static_cast<std::size_t>(turn * static_cast<float>(columns)), columns - 1);
    const std::size_t pixel = rows_[i] * columns + column;
    if (!std::isnan(points_[pixel].x())) continue;
    points_[pixel] = p;
    if (times) seconds_[pixel] = static_cast<float>(point_time(cloud, i));
  }
  Cloud image;
  image.stamp_ns = cloud.stamp_ns;
  image.points = std::span<const Point3f>(points_);
  image.seconds = std::span<const float>(seconds_);
  image.width = columns;
  image.height = rows;
  return image;
}

}  // namespace adit::lidar_odometry
