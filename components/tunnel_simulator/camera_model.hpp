// Pinhole camera with the Brown-Conrady distortion of OpenCV's "plumb_bob": x right, y down, z forward.
#pragma once

#include <optional>

#include <Eigen/Core>

namespace adit::tunnel_simulator {

struct CameraModel {
  int width = 640, height = 512;
  double fx = 417.0, fy = 417.0, cx = 319.5, cy = 255.5;  // px; pixel centres are integers
  double k1 = 0.0, k2 = 0.0, p1 = 0.0, p2 = 0.0, k3 = 0.0;

  // Square pixels, principal point in the middle of the image.
  static CameraModel from_hfov(int width, int height, double hfov);

  // Normalized image plane -> distorted normalized plane.
  Eigen::Vector2d distort(const Eigen::Vector2d& plane) const;
  // The inverse by Newton's method to 1e-12; nothing where the model cannot be inverted.
  std::optional<Eigen::Vector2d> undistort(const Eigen::Vector2d& distorted) const;
  Eigen::Vector2d project(const Eigen::Vector3d& point) const;
  // Unit ray of a pixel; +z where the model cannot be inverted.
  Eigen::Vector3d ray(const Eigen::Vector2d& pixel) const;
};

}  // namespace adit::tunnel_simulator
