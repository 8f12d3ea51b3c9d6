// Every generated type by name, with its operations on serialized bytes: for tools that meet a type at run time (echo,
// recorder, tests). Any thread.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "idl/codec.hpp"
#include "idl/json_writer.hpp"

namespace adit {

struct MessageType {
  const TypeInfo* info;
  // Empty, or which of the types of one ROS name this is: "humble" for rmw_dds_common/msg/ParticipantEntitiesInfo with
  // the 24-byte gids of ROS 2 Humble and older.
  std::string_view variant;

  // Appends the decoded payload to `out` as JSON; nothing is appended on failure.
  DecodeStatus (*to_json)(Bytes payload, std::string& out, const JsonOptions& options);
  // Decodes, then encodes again into `out`: the payload in canonical form (little endian, zero padding, nothing
  // behind).
  DecodeStatus (*reencode)(Bytes payload, std::vector<std::byte>& out);
  // A default-constructed message, encoded.
  std::vector<std::byte> (*default_sample)();
};

// Ordered by name.
std::span<const MessageType> all_types();

// By ROS name ("nav_msgs/msg/Odometry") or DDS name ("nav_msgs::msg::dds_::Odometry_"); nullptr when there is none.
const MessageType* find_type(std::string_view name, std::string_view variant = {});

}  // namespace adit
