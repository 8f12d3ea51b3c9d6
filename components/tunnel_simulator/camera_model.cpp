#include "components/tunnel_simulator/camera_model.hpp"

#include <cmath>

#include <Eigen/LU>

namespace adit::tunnel_simulator {

CameraModel CameraModel::from_hfov(int width, int height, double hfov) {
  CameraModel m;
  m.width = width;
  m.height = height;
  m.fx = m.fy = 0.5 * width / std::tan(0.5 * hfov);
  m.cx = 0.5 * (width - 1);
  m.cy = 0.5 * (height - 1);
  return m;
}

Eigen::Vector2d CameraModel::distort(const Eigen::Vector2d& p) const {
  const double x = p.x(), y = p.y();
  const double r2 = x * x + y * y;
  const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
  return {x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
          y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y};
}

std::optional<Eigen::Vector2d> CameraModel::undistort(const Eigen::Vector2d& distorted) const {
  Eigen::Vector2d p = distorted;
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector2d error = distort(p) - distorted;
    const double x = p.x(), y = p.y();
    const double r2 = x * x + y * y;
    const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    const double slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2));
    Eigen::Matrix2d jacobian;
    jacobian << radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x, x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y,
        x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y, radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
    if (error.squaredNorm() < 1e-24) {
      // Beyond the fold of a strong model lie further roots, turned over: not what a lens shows.
      const bool upright = radial > 0.0 && jacobian.determinant() > 0.0;
      return upright ? std::optional(p) : std::nullopt;
    }
    if (std::abs(jacobian.determinant()) < 1e-6) return std::nullopt;
    p -= jacobian.inverse() * error;
  }
  return std::nullopt;
}

Eigen::Vector2d CameraModel::project(const Eigen::Vector3d& point) const {
  const Eigen::Vector2d d = distort(point.head<2>() / point.z());
  return {fx * d.x() + cx, fy * d.y() + cy};
}

Eigen::Vector3d CameraModel::ray(const Eigen::Vector2d& pixel) const {
  const auto plane = undistort({(pixel.x() - cx) / fx, (pixel.y() - cy) / fy});
  return plane ? Eigen::Vector3d(plane->x(), plane->y(), 1.0).normalized() : Eigen::Vector3d(0.0, 0.0, 1.0);
}

}  // namespace adit::tunnel_simulator
