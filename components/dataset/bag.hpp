// What a bag holds: serialized samples by topic, as rosbag2 stores them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "idl/bytes.hpp"

namespace adit::dataset {

struct BagTopic {
  std::string name;       // "/lidar/points"
  std::string type;       // ROS name: "sensor_msgs/msg/PointCloud2"
  std::string qos;        // YAML list of the offered profiles, rosbag2's text (bag_qos.hpp); may be empty
  std::string type_hash;  // RIHS01_...; empty when the bag does not say
  std::string schema;     // ros2msg text with its dependencies; empty when the bag does not say
};

// A sample of a bag. `cdr` starts with the 4-byte encapsulation header; see where it comes from for how long it is
// valid.
struct BagSample {
  std::size_t topic = 0;      // index into the bag's topics
  std::int64_t stamp_ns = 0;  // when it was received (or arrived, in the simulator's time)
  Bytes cdr;
};

}  // namespace adit::dataset
