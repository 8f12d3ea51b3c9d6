#include "idl/point_cloud_writer.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit {
namespace {

using sensor_msgs::msg::PointCloud2;
using sensor_msgs::msg::PointField;

struct LayoutField {
  const char* name;
  std::uint32_t offset;
  std::uint8_t datatype;
};

struct Layout {
  std::span<const LayoutField> fields;
  std::uint32_t point_step;
};

constexpr LayoutField xyzi_fields[] = {{"x", 0, PointField::FLOAT32},
                                       {"y", 4, PointField::FLOAT32},
                                       {"z", 8, PointField::FLOAT32},
                                       {"intensity", 12, PointField::FLOAT32}};
constexpr LayoutField velodyne_fields[] = {{"x", 0, PointField::FLOAT32},    {"y", 4, PointField::FLOAT32},
                                           {"z", 8, PointField::FLOAT32},    {"intensity", 12, PointField::FLOAT32},
                                           {"ring", 16, PointField::UINT16}, {"time", 18, PointField::FLOAT32}};
constexpr LayoutField ouster_fields[] = {{"x", 0, PointField::FLOAT32},    {"y", 4, PointField::FLOAT32},
                                         {"z", 8, PointField::FLOAT32},    {"intensity", 16, PointField::FLOAT32},
                                         {"t", 20, PointField::UINT32},    {"reflectivity", 24, PointField::UINT16},
                                         {"ring", 26, PointField::UINT16}, {"ambient", 28, PointField::UINT16},
                                         {"range", 32, PointField::UINT32}};

Layout layout_of(PointLayout layout) {
  switch (layout) {
    case PointLayout::xyzi:
      return {xyzi_fields, 16};
    case PointLayout::velodyne:
      return {velodyne_fields, 22};
    case PointLayout::ouster:
      break;
  }
  return {ouster_fields, 48};
}

template <class T>
void store(std::uint8_t* point, std::size_t offset, T value) {
  std::memcpy(point + offset, &value, sizeof value);
}

template <class T>
T clamped(double value) {
  if (!(value > 0.0)) return 0;  // NaN too
  return value >= static_cast<double>(std::numeric_limits<T>::max()) ? std::numeric_limits<T>::max()
                                                                     : static_cast<T>(std::llround(value));
}

void write_point(const LidarPoint& from, PointLayout layout, std::uint8_t* to) {
  store(to, 0, from.x);
  store(to, 4, from.y);
  store(to, 8, from.z);
  switch (layout) {
    case PointLayout::xyzi:
      store(to, 12, from.intensity);
      break;
    case PointLayout::velodyne:
      store(to, 12, from.intensity);
      store(to, 16, from.ring);
      store(to, 18, static_cast<float>(from.time));
      break;
    case PointLayout::ouster:
      std::memset(to + 12, 0, 36);
      store(to, 16, from.intensity);
      store(to, 20, clamped<std::uint32_t>(from.time * 1e9));
      store(to, 24, clamped<std::uint16_t>(from.intensity));
      store(to, 26, from.ring);
      store(to, 32, clamped<std::uint32_t>(1e3 * std::hypot(from.x, from.y, from.z)));
      break;
  }
}

}  // namespace

Result<> write_points(std::span<const LidarPoint> points, std::uint32_t height, PointLayout layout, PointCloud2& out) {
  if (height == 0 || points.size() % height != 0) {
    return Error{ErrorCode::invalid_argument, std::to_string(points.size()) + " points do not make " +
                                                  std::to_string(height) + " rows of equal length"};
  }
  const Layout shape = layout_of(layout);
  const std::size_t width = points.size() / height;
  if (width > std::numeric_limits<std::uint32_t>::max() / shape.point_step) {
    return Error{ErrorCode::invalid_argument, "too many points for one row of a cloud: " + std::to_string(width)};
  }
  out.height = height;
  out.width = static_cast<std::uint32_t>(width);
  out.point_step = shape.point_step;
  out.row_step = out.width * shape.point_step;
  out.is_bigendian = std::endian::native == std::endian::big;
  out.fields.resize(shape.fields.size());
  for (std::size_t i = 0; i < shape.fields.size(); ++i) {
    const LayoutField& field = shape.fields[i];
    out.fields[i].name = field.name;
    out.fields[i].offset = field.offset;
    out.fields[i].datatype = field.datatype;
    out.fields[i].count = 1;
  }
  out.data.resize(points.size() * shape.point_step);
  out.is_dense = true;
  std::uint8_t* to = out.data.mutable_data();
  for (const LidarPoint& point : points) {
    write_point(point, layout, to);
    to += shape.point_step;
    out.is_dense = out.is_dense && std::isfinite(point.x) && std::isfinite(point.y) && std::isfinite(point.z);
  }
  return {};
}

}  // namespace adit
