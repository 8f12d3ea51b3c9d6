// How ROS 2 names appear in DDS, and back (design.ros2.org, "Topic and Service name mapping to DDS").
#pragma once

#include <string>
#include <string_view>

#include "idl/result.hpp"

namespace adit {

// Refuses what ROS 2 would refuse: a fully qualified name is '/' and tokens of [A-Za-z0-9_] that do not start with a
// digit, joined by single '/'.
Result<void> validate_ros_name(std::string_view name);

// "/lidar/points" <-> "rt/lidar/points". Names without a leading '/' are raw DDS names and stay as they are; so does,
// on the way back, every DDS topic that is not a ROS topic.
std::string to_dds_topic(std::string_view ros_topic);
std::string from_dds_topic(std::string_view dds_topic);

// "sensor_msgs::msg::dds_::PointCloud2_" -> "sensor_msgs/msg/PointCloud2"; other names unchanged.
std::string from_dds_type(std::string_view dds_type);

// "/perception/lidar" -> {"/perception", "lidar"}; "/lidar" -> {"/", "lidar"}.
struct NodeName {
  std::string node_namespace;
  std::string name;
};
NodeName split_node_name(std::string_view fully_qualified);
std::string join_node_name(std::string_view node_namespace, std::string_view name);

// The value of `key` in USER_DATA of the form "key=value;key=value;", empty when absent.
std::string_view user_data_value(std::string_view user_data, std::string_view key);

}  // namespace adit
