// Writes sensor_msgs/PointCloud2 in the layouts that LiDAR drivers publish: for players and simulators.
#pragma once

#include <cstdint>
#include <span>

#include "idl/result.hpp"

namespace adit::sensor_msgs::msg {
struct PointCloud2;
}

namespace adit {

struct LidarPoint {
  float x = 0.0f, y = 0.0f, z = 0.0f;  // m; NaN: no return
  float intensity = 0.0f;
  double time = 0.0;  // s after the header's stamp
  std::uint16_t ring = 0;
};

enum class PointLayout {
  xyzi,      // x, y, z, intensity: float32; 16 bytes
  velodyne,  // and ring: uint16, time: float32 in seconds; 22 bytes
  ouster,    // and t: uint32 in nanoseconds, reflectivity, ring, ambient: uint16, range: uint32 in mm; 48 bytes
};

// Replaces everything of `out` but its header. `points` are `height` rows of equal length (1: not organized). Reuses
// the memory of `out`. Times outside what a field can hold are clamped to it.
Result<> write_points(std::span<const LidarPoint> points, std::uint32_t height, PointLayout layout,
                      sensor_msgs::msg::PointCloud2& out);

}  // namespace adit
