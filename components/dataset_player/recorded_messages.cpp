#include "components/dataset_player/recorded_messages.hpp"

#include <bit>
#include <cstring>
#include <limits>

#include "components/runtime/stamp.hpp"
#include "sensor_msgs/msg/point_field.hpp"

namespace adit::dataset_player {
namespace {

constexpr bool big_endian = std::endian::native == std::endian::big;

// Pixels as bytes of the machine's own order.
void copy_pixels(const dataset::Image16& image, Blob& out) {
  out.resize(image.pixels.size() * sizeof(std::uint16_t));
  std::memcpy(out.mutable_data(), image.pixels.data(), out.size());
}

}  // namespace

void fill(const dataset::PointFile& cloud, Time stamp, const std::string& frame_id,
          sensor_msgs::msg::PointCloud2& out) {
  out.header.stamp = to_stamp(stamp);
  out.header.frame_id = frame_id;
  out.height = 1;
  out.width = static_cast<std::uint32_t>(cloud.points);
  out.fields.resize(cloud.fields.size());
  for (std::size_t i = 0; i < cloud.fields.size(); ++i) {
    out.fields[i].name = cloud.fields[i];
    out.fields[i].offset = static_cast<std::uint32_t>(i * sizeof(float));
    out.fields[i].datatype = sensor_msgs::msg::PointField::FLOAT32;
    out.fields[i].count = 1;
  }
  out.is_bigendian = big_endian;
  out.point_step = static_cast<std::uint32_t>(cloud.fields.size() * sizeof(float));
  out.row_step = out.point_step * out.width;
  out.data.assign({reinterpret_cast<const std::uint8_t*>(cloud.values.data()), cloud.values.size() * sizeof(float)});
  out.is_dense = false;
}

void fill(const dataset::Image16& image, Time stamp, const std::string& frame_id, std::uint32_t counter,
          adit_msgs::msg::ThermalFrame& out) {
  const float unknown = std::numeric_limits<float>::quiet_NaN();
  Blob pixels = std::move(out.data);
  out = {};
  out.data = std::move(pixels);
  out.header.stamp = to_stamp(stamp);
  out.header.frame_id = frame_id;
  out.height = image.height;
  out.width = image.width;
  out.step = image.width * 2;
  out.is_bigendian = big_endian;
  out.significant_bits = 16;
  copy_pixels(image, out.data);
  out.time_since_ffc = unknown;
  out.focal_plane_temperature = unknown;
  out.integration_time = unknown;
  out.readout_time = unknown;
  out.frame_counter = counter;
}

void fill(const dataset::Image16& image, Time stamp, const std::string& frame_id, sensor_msgs::msg::Image& out) {
  out.header.stamp = to_stamp(stamp);
  out.header.frame_id = frame_id;
  out.height = image.height;
  out.width = image.width;
  out.encoding = "mono16";
  out.is_bigendian = big_endian ? 1 : 0;
  out.step = image.width * 2;
  copy_pixels(image, out.data);
}

void fill(const StampedPose& pose, const std::string& frame, const std::string& child_frame,
          nav_msgs::msg::Odometry& out) {
  out.header.stamp = to_stamp(Time(Duration(pose.stamp_ns)));
  out.header.frame_id = frame;
  out.child_frame_id = child_frame;
  const Eigen::Quaterniond q(pose.pose.linear());
  const Eigen::Vector3d t = pose.pose.translation();
  out.pose.pose.position = {t.x(), t.y(), t.z()};
  out.pose.pose.orientation = {q.x(), q.y(), q.z(), q.w()};
}

}  // namespace adit::dataset_player
