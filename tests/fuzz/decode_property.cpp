#include "tests/fuzz/decode_property.hpp"

#include <cmath>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "idl/point_cloud_view.hpp"
#include "idl/thermal_frame_view.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit::test {
namespace {

std::string check_cloud(Bytes payload) {
  sensor_msgs::msg::PointCloud2 cloud;
  if (decode(payload, cloud) != DecodeStatus::ok) return "decodes with the registry only";
  const auto view = PointCloudView::of(cloud);
  if (!view) return view.error().message.empty() ? "refusal without a reason" : "";
  PointColumns columns;
  view->copy_to(columns);
  if (columns.x.size() > view->size() || columns.x.size() != columns.index.size()) return "columns of unequal length";
  for (std::size_t i = 0; i < columns.x.size(); ++i) {
    if (!std::isfinite(columns.x[i] + columns.y[i] + columns.z[i]) &&
        !(std::isfinite(columns.x[i]) && std::isfinite(columns.y[i]) && std::isfinite(columns.z[i]))) {
      return "a point that is not finite";
    }
  }
  return "";
}

template <class T>
std::string check_thermal(Bytes payload) {
  T frame;
  if (decode(payload, frame) != DecodeStatus::ok) return "decodes with the registry only";
  const auto view = ThermalFrameView::of(frame);
  if (!view) return view.error().message.empty() ? "refusal without a reason" : "";
  std::vector<std::uint16_t> pixels(view->size());
  view->copy_to(pixels);
  return pixels.back() == view->at(view->height() - 1, view->width() - 1) ? "" : "copy and access differ";
}

}  // namespace

std::string check_decode(const MessageType& type, Bytes payload) {
  std::vector<std::byte> once, twice;
  if (type.reencode(payload, once) != DecodeStatus::ok) return "";
  if (type.reencode(once, twice) != DecodeStatus::ok) return "an encoded message does not decode";
  if (once != twice) return "an encoded message decodes to another";
  if (type.info->ros_name == "sensor_msgs/msg/PointCloud2") return check_cloud(payload);
  if (type.info->ros_name == "sensor_msgs/msg/Image") return check_thermal<sensor_msgs::msg::Image>(payload);
  if (type.info->ros_name == "adit_msgs/msg/ThermalFrame") return check_thermal<adit_msgs::msg::ThermalFrame>(payload);
  return "";
}

}  // namespace adit::test
