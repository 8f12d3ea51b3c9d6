// What `adit odometry` writes of a run, whichever the sensor.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "components/geometry/trajectory.hpp"
#include "idl/result.hpp"
#include "nav_msgs/msg/odometry.hpp"

namespace adit {

// How long the components worked on one file.
struct FileTiming {
  std::int64_t stamp_ns;
  double milliseconds;
};

StampedPose stamped_pose(const nav_msgs::msg::Odometry& message);

// CSV: stamp_ns,ms.
Result<void> write_timing(const std::string& path, std::span<const FileTiming> timing);

}  // namespace adit
