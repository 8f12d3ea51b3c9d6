#include "idl/point_cloud_view.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstring>
#include <limits>
#include <string>

#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit {
namespace {

using sensor_msgs::msg::PointCloud2;
using sensor_msgs::msg::PointField;

std::size_t size_of(std::uint8_t datatype) {
  switch (datatype) {
    case PointField::INT8:
    case PointField::UINT8:
      return 1;
    case PointField::INT16:
    case PointField::UINT16:
      return 2;
    case PointField::INT32:
    case PointField::UINT32:
    case PointField::FLOAT32:
      return 4;
    case PointField::FLOAT64:
      return 8;
    default:
      return 0;
  }
}

template <class T, bool swap>
T load(const std::uint8_t* from) {
  std::array<std::uint8_t, sizeof(T)> bytes;
  std::memcpy(bytes.data(), from, sizeof(T));
  if constexpr (swap) std::reverse(bytes.begin(), bytes.end());
  return std::bit_cast<T>(bytes);
}

// Calls `use(load function)` with the loader of the datatype: the choice is made once, not once a point.
template <class Use>
auto with_loader(std::uint8_t datatype, bool swap, const Use& use) {
  const auto pick = [&]<class T>(T) { return swap ? use(&load<T, true>) : use(&load<T, false>); };
  switch (datatype) {
    case PointField::INT8:
      return pick(std::int8_t{});
    case PointField::UINT8:
      return pick(std::uint8_t{});
    case PointField::INT16:
      return pick(std::int16_t{});
    case PointField::UINT16:
      return pick(std::uint16_t{});
    case PointField::INT32:
      return pick(std::int32_t{});
    case PointField::UINT32:
      return pick(std::uint32_t{});
    case PointField::FLOAT32:
      return pick(float{});
    default:
      return pick(double{});
  }
}

Error malformed(std::string text) {
  return {ErrorCode::malformed, "point cloud: " + std::move(text)};
}

// Conversion that is defined for every value: out of range becomes the nearest, NaN becomes zero for integers.
template <class To, class From>
To convert(From value) {
  if constexpr (std::integral<To> && std::floating_point<From>) {
    if (!(value > From(0))) return 0;
    return value >= From(std::numeric_limits<To>::max()) ? std::numeric_limits<To>::max() : static_cast<To>(value);
  } else {
    return static_cast<To>(value);
  }
}

}  // namespace

Result<PointCloudView> PointCloudView::of(const PointCloud2& cloud, PointTimeUnit time_unit) {
  PointCloudView view;
  view.fields_ = &cloud.fields;
  view.data_ = cloud.data.data();
  view.width_ = cloud.width;
  view.height_ = cloud.height;
  view.point_step_ = cloud.point_step;
  view.swap_ = cloud.is_bigendian != (std::endian::native == std::endian::big);

  // Products of two 32-bit numbers: no overflow in 64 bits. Nothing is stored in a size_t, 32 bits on small boards,
  // before the data have been found to hold it.
  const std::uint64_t row_bytes = std::uint64_t{cloud.width} * cloud.point_step;
  const std::uint64_t points = std::uint64_t{cloud.width} * cloud.height;
  std::uint64_t row_step = cloud.row_step;
  if (cloud.height <= 1) row_step = std::max(row_step, row_bytes);  // drivers leave it zero
  if (points > 0) {
    if (row_step < row_bytes) {
      return malformed("row_step " + std::to_string(cloud.row_step) + " is less than width " +
                       std::to_string(cloud.width) + " times point_step " + std::to_string(cloud.point_step));
    }
    // The padding behind the last row may be missing.
    const std::uint64_t needed = std::uint64_t{cloud.height - 1} * row_step + row_bytes;
    if (cloud.data.size() < needed) {
      return malformed("data holds " + std::to_string(cloud.data.size()) + " bytes, " + std::to_string(cloud.height) +
                       " rows of " + std::to_string(row_step) + " bytes need " + std::to_string(needed));
    }
    view.row_step_ = static_cast<std::size_t>(row_step);
  }
  if (points == 0) view.width_ = view.height_ = 0;  // 2^32 rows of nothing are nothing
  if (points > std::numeric_limits<std::uint32_t>::max()) return malformed("more than 2^32 points");

  const auto require = [&](std::string_view name, Field& to) -> Result<> {
    const auto found = view.field(name);
    if (!found) return found.error();
    to = *found;
    return {};
  };
  if (auto result = require("x", view.x_); !result) return result.error();
  if (auto result = require("y", view.y_); !result) return result.error();
  if (auto result = require("z", view.z_); !result) return result.error();

  auto intensity = view.find({"intensity", "i", "reflectivity", "signal", "signal_photons"});
  if (!intensity) return intensity.error();
  view.intensity_ = *intensity;
  auto ring = view.find({"ring", "line", "channel", "laser_id", "laser_number", "row"});
  if (!ring) return ring.error();
  view.ring_ = *ring;
  auto time = view.find({"t", "time", "timestamp", "offset_time", "time_offset", "time_stamp", "point_time_offset"});
  if (!time) return time.error();
  view.time_ = *time;
  if (time_unit == PointTimeUnit::unused) view.time_.reset();
  if (view.time_) {
    const double stamp = cloud.header.stamp.sec + 1e-9 * cloud.header.stamp.nanosec;
    if (auto found = view.find_time_scale(time_unit, stamp); !found) return found.error();
  }
  return view;
}

Result<PointCloudView::Field> PointCloudView::field(std::string_view name) const {
  for (const PointField& field : *fields_) {
    if (field.name != name) continue;
    const std::size_t size = size_of(field.datatype);
    if (size == 0) {
      return malformed("field " + field.name + " has the unknown datatype " + std::to_string(field.datatype));
    }
    if (std::uint64_t{field.offset} + size > point_step_) {
      return malformed("field " + field.name + " at offset " + std::to_string(field.offset) +
                       " reaches beyond point_step " + std::to_string(point_step_));
    }
    return Field{field.offset, field.datatype};
  }
  return Error{ErrorCode::not_found, "point cloud: no field " + std::string(name)};
}

Result<std::optional<PointCloudView::Field>> PointCloudView::find(std::initializer_list<std::string_view> names) const {
  for (const std::string_view name : names) {
    const auto found = field(name);
    if (found) return std::optional<Field>(*found);
    if (found.error().code != ErrorCode::not_found) return found.error();
  }
  return std::optional<Field>();
}

double PointCloudView::value(const Field& field, std::size_t index) const {
  const std::uint8_t* const from = point(index) + field.offset;
  return with_loader(field.datatype, swap_, [&](auto loader) { return static_cast<double>(loader(from)); });
}

std::array<float, 3> PointCloudView::position(std::size_t index) const {
  const auto coordinate = [&](const Field& field) { return static_cast<float>(value(field, index)); };
  return {coordinate(x_), coordinate(y_), coordinate(z_)};
}

float PointCloudView::intensity(std::size_t index) const {
  return static_cast<float>(value(*intensity_, index));
}

std::uint16_t PointCloudView::ring(std::size_t index) const {
  return convert<std::uint16_t>(value(*ring_, index));
}

double PointCloudView::time(std::size_t index) const {
  return (value(*time_, index) - time_origin_) * time_scale_;
}

Result<> PointCloudView::find_time_scale(PointTimeUnit unit, double stamp) {
  constexpr std::size_t looked_at = 64;
  constexpr double longest_scan = 5.0;       // s
  constexpr double clock_difference = 60.0;  // s
  constexpr double float32_limit = 16384.0;  // s: beyond, float32 has steps of 2 ms
  double largest = 0.0;
  const std::size_t stride = std::max<std::size_t>(1, size() / looked_at);
  for (std::size_t i = 0; i < size(); i += stride) {
    const double value = std::abs(this->value(*time_, i));
    if (std::isfinite(value)) largest = std::max(largest, value);
  }
  bool absolute = false;
  if (unit == PointTimeUnit::automatic) {
    const bool integer = time_->datatype != PointField::FLOAT32 && time_->datatype != PointField::FLOAT64;
    unit = integer ? PointTimeUnit::nanoseconds : PointTimeUnit::seconds;
    if (!integer) {
      if (largest >= 1e17)
        unit = PointTimeUnit::nanoseconds;
      else if (largest >= 1e14)
        unit = PointTimeUnit::microseconds;
      else if (largest >= 1e11)
        unit = PointTimeUnit::milliseconds;
      absolute = largest > longest_scan;
    }
  }
  switch (unit) {
    case PointTimeUnit::unused:
    case PointTimeUnit::automatic:
    case PointTimeUnit::seconds:
      time_scale_ = 1.0;
      break;
    case PointTimeUnit::milliseconds:
      time_scale_ = 1e-3;
      break;
    case PointTimeUnit::microseconds:
      time_scale_ = 1e-6;
      break;
    case PointTimeUnit::nanoseconds:
      time_scale_ = 1e-9;
      break;
  }
  absolute = absolute || largest * time_scale_ >= 1e8;
  if (absolute) {
    const double latest = largest * time_scale_;
    const bool too_coarse = time_->datatype == PointField::FLOAT32 && latest > float32_limit;
    if (too_coarse || std::abs(latest - stamp) > clock_difference) {
      return malformed("point times up to " + std::to_string(largest) + " are neither offsets within a scan nor near " +
                       "the stamp " + std::to_string(stamp) + ": name their unit, or leave them unused");
    }
    time_origin_ = stamp / time_scale_;
  }
  return {};
}

template <class T>
void PointCloudView::copy_column(const Field& field, std::vector<T>& out) const {
  out.resize(size());
  with_loader(field.datatype, swap_, [&](auto loader) {
    std::size_t at = 0;
    for (std::size_t row = 0; row < height_; ++row) {
      const std::uint8_t* from = data_ + row * row_step_ + field.offset;
      for (std::size_t column = 0; column < width_; ++column, from += point_step_) out[at++] = convert<T>(loader(from));
    }
  });
}

void PointCloudView::copy_to(PointColumns& out, NonFinitePoints non_finite) const {
  copy_column(x_, out.x);
  copy_column(y_, out.y);
  copy_column(z_, out.z);
  out.intensity.clear(), out.ring.clear(), out.time.clear();
  if (intensity_) copy_column(*intensity_, out.intensity);
  if (ring_) copy_column(*ring_, out.ring);
  if (time_) {
    copy_column(*time_, out.time);
    for (double& time : out.time) time = (time - time_origin_) * time_scale_;
  }
  out.index.resize(size());
  for (std::size_t i = 0; i < out.index.size(); ++i) out.index[i] = static_cast<std::uint32_t>(i);
  if (non_finite == NonFinitePoints::keep) return;

  std::size_t kept = 0;
  for (std::size_t i = 0; i < size(); ++i) {
    if (!std::isfinite(out.x[i]) || !std::isfinite(out.y[i]) || !std::isfinite(out.z[i])) continue;
    if (!out.time.empty() && !std::isfinite(out.time[i])) continue;
    if (kept != i) {
      const auto move = [&](auto& column) {
        if (!column.empty()) column[kept] = column[i];
      };
      move(out.x), move(out.y), move(out.z), move(out.intensity), move(out.ring), move(out.time), move(out.index);
    }
    ++kept;
  }
  const auto shorten = [&](auto& column) {
    if (!column.empty()) column.resize(kept);
  };
  shorten(out.x), shorten(out.y), shorten(out.z), shorten(out.intensity), shorten(out.ring), shorten(out.time);
  shorten(out.index);
}

}  // namespace adit
