// What the middleware needs to know of a type, and how a message writes itself into the middleware's buffer.
#pragma once

#include <cstddef>
#include <string_view>

#include "idl/bytes.hpp"

namespace adit {

// Generated constants of one message type; every view refers to static storage.
struct TypeInfo {
  std::string_view ros_name;   // "sensor_msgs/msg/PointCloud2"
  std::string_view dds_name;   // "sensor_msgs::msg::dds_::PointCloud2_"
  std::string_view type_hash;  // "RIHS01_<64 hex digits>" (REP-2011/2016)
  std::string_view schema;     // ros2msg text with its dependencies, as MCAP's "ros2msg" encoding wants it
  std::size_t typical_size;    // bytes of a usual serialized sample: sizes preallocated pools
};

// Serializes one message into a buffer that somebody else owns, so that a sample is encoded straight into the vendor's
// memory. An Encoder refers to its message: it must not outlive it.
class Encoder {
 public:
  // Exact bytes of the serialized sample, the 4-byte encapsulation header included.
  virtual std::size_t size() const = 0;
  // Writes the sample; `out` holds at least size() bytes. Returns the bytes written, 0 when the buffer is too small.
  virtual std::size_t write(MutableBytes out) const = 0;

 protected:
  ~Encoder() = default;
};

}  // namespace adit
