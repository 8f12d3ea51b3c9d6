// The paper's picture: the frame in grey, the points the odometry uses on it, coloured by their depth.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "components/thermal_odometry/frame.hpp"
#include "components/thermal_odometry/thermal_odometry.hpp"

namespace adit::thermal_odometry {

// Near is red, far is blue, by the logarithm of the depth.
struct DepthColours {
  float near = 2.0F;  // m, or the map's unit
  float far = 40.0F;
};

// `rgb` gets 3 bytes a pixel, row after row. Grey is stretched between the frame's 1 % and 99 % counts: for the eye
// only. Points that are not anchored are drawn smaller.
void draw_points(const Frame& frame, const CameraModel& camera, std::span<const MapPoint> points,
                 const DepthColours& colours, std::span<std::uint8_t> rgb, std::vector<std::uint16_t>& scratch);

}  // namespace adit::thermal_odometry
