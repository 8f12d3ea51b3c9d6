// What ROS 2 says of a type: its names, its RIHS01 hash (REP-2016) and its .msg text.
#pragma once

#include <string>
#include <vector>

#include "idl/generator/model.hpp"

namespace adit::generator {

// "sensor_msgs/msg/PointCloud2"
std::string ros_name(const Struct& type);
// "sensor_msgs::msg::dds_::PointCloud2_"
std::string dds_name(const Struct& type);
// "RIHS01_<64 hex digits>": SHA-256 of the JSON type description.
std::string type_hash(const Model& model, const Struct& type);
// .msg text of the type, then of every type it contains, as MCAP's "ros2msg" encoding wants them.
std::string ros2msg(const Model& model, const Struct& type);
// Serialized bytes that no value of the type falls below, padding not counted.
std::size_t minimum_size(const Model& model, const Struct& type);
// Serialized bytes of a usual sample: a guess from the shape of the type.
std::size_t typical_size(const Model& model, const Struct& type);
// "PointCloud2" -> "point_cloud2", rosidl's rule for file names.
std::string snake_case(const std::string& name);

}  // namespace adit::generator
