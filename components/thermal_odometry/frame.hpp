// What goes in: views on the caller's memory, valid during the call only.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include <Eigen/Core>

#include "components/geometry/se3.hpp"

namespace adit::thermal_odometry {

// Shutter (flat-field correction) state as the camera's telemetry gives it.
enum class FfcState : std::uint8_t { unknown, idle, imminent, in_progress };

// A 16-bit image, row-major, raw counts linear in radiance. Nothing here is ever reduced to 8 bits.
struct Frame {
  const std::uint16_t* data = nullptr;
  int width = 0;
  int height = 0;
  int stride = 0;             // elements from row to row; 0: width
  std::int64_t stamp_ns = 0;  // middle of the exposure, including the detector's thermal lag where it is known
  FfcState ffc = FfcState::unknown;
  int saturation = 65535;  // counts at which a pixel says nothing
};

enum class Distortion : std::uint8_t { none, plumb_bob, rational };

// Pinhole with OpenCV's distortion polynomials. Pixel centres are at integer coordinates; x right, y down, z forward.
struct CameraModel {
  int width = 0;
  int height = 0;
  double fx = 0.0;
  double fy = 0.0;
  double cx = 0.0;
  double cy = 0.0;
  Distortion distortion = Distortion::none;
  std::array<double, 8> coefficients{};  // k1 k2 p1 p2 k3 [k4 k5 k6]
  double row_time = 0.0;                 // s from row to row of a rolling readout; the stamp is that of the middle row
};

// LiDAR points with the pose of their sensor in the camera. A cloud its sensor side calls degraded (smoke) must not be
// given: near-field returns would be taken for walls.
struct DepthPoints {
  std::span<const Eigen::Vector3f> points;  // sensor frame [m]
  std::span<const float> time_offsets_s;    // of each point from stamp_ns; empty: all at stamp_ns
  std::int64_t stamp_ns = 0;
  Pose T_camera_sensor = Pose::Identity();
};

// Motion since the previous frame as a filter predicts it, in the camera frame and in metres.
struct Prior {
  Pose T_previous_current = Pose::Identity();
  Matrix6d covariance =
      Matrix6d::Identity();  // of the left increment exp(xi) T_previous_current, [translation, rotation]
};

}  // namespace adit::thermal_odometry
