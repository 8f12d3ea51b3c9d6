// LiDAR depth at image pixels: occlusion-safe projection and a local plane in inverse depth (which is affine in image
// coordinates for a plane in space). Idea: Shin and Kim, "Sparse depth enhanced direct thermal-infrared SLAM", 2019.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "components/geometry/se3.hpp"
#include "components/thermal_odometry/camera.hpp"

namespace adit::thermal_odometry {

// Inverse depth around a pixel: d(u, v) = inverse_depth + slope_u du + slope_v dv.
struct AnchorDepth {
  float inverse_depth;  // 1/m
  float slope_u;        // 1/(m px)
  float slope_v;
  float sigma;  // standard deviation of inverse_depth
};

class DepthAnchor {
 public:
  struct Config {
    float min_range = 1.0F;  // m, along z
    float max_range = 80.0F;
    float radius = 8.0F;  // px, search window
    int min_points = 4;
    float max_residual = 0.03F;  // of the inverse depth: larger is an edge
    float range_sigma = 0.015F;  // m
    float relative_sigma = 0.003F;
  };
  DepthAnchor(const Pinhole& camera, int width, int height, std::size_t capacity, const Config& config);
  // Points in the camera frame at the image's time [m]; those beyond the capacity are left out evenly.
  // `rate`: of the camera, d/dt T_cw = rate T_cw, for a rolling readout.
  void project(std::span<const Eigen::Vector3f> points, const Vector6d& rate = Vector6d::Zero());
  // Depth of one pixel of the image last projected into; nothing without enough support.
  std::optional<AnchorDepth> depth_at(float u, float v) const;
  std::size_t visible_points() const { return sorted_.size(); }

 private:
  struct Projection {
    float u;
    float v;
    float inverse_depth;
    std::int32_t cell;
  };
  void remove_hidden();

  Pinhole camera_;
  int width_;
  int height_;
  std::size_t capacity_;
  Config config_;
  int columns_;
  int rows_;
  std::vector<Projection> projected_;
  std::vector<Projection> sorted_;   // by cell
  std::vector<std::int32_t> first_;  // of each cell, into sorted_
  std::vector<float> nearest_;       // inverse depth a cell: the z-buffer
};

}  // namespace adit::thermal_odometry
