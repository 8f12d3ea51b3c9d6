// How much a match really says about each direction, and what to make of it: the cure for normal equations that look
// regular in a tunnel because noisy normals add up to "information" about the axis.
//
// Each matched surfel has two independent normals, the map's and its own. The product of their sensitivities to a
// motion has zero mean where only noise speaks, so its sum needs no calibrated floor (cross-validation); parts of the
// image are limited in what they may contribute, and a common tilt of all normals is allowed for.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "components/geometry/se3.hpp"
#include "components/lidar_odometry/config.hpp"
#include "components/lidar_odometry/estimate.hpp"
#include "components/lidar_odometry/surfel.hpp"

namespace adit::lidar_odometry {

// One matched surfel in map axes.
struct Constraint {
  Eigen::Vector3f lever;          // m, from the sensor
  Eigen::Vector3f map_normal;     // unit
  Eigen::Vector3f source_normal;  // unit
  float weight = 0.0f;            // 1/m^2; 0: no match
  std::uint16_t cluster = 0;
  float time = 0.0f;  // s, of the point, from the instant of the pose
};

// Independent directions of a Hessian: three translations, each with the rotation that goes along, and three pure
// rotations. In the coordinates z, x = basis z, the Hessian is diagonal.
struct Directions {
  Matrix6d basis;                           // columns
  Matrix6d to_coordinates;                  // inverse of basis
  Vector6d curvature;                       // of the Hessian along each column
  Vector6d information = Vector6d::Zero();  // effective, 1/m^2 and 1/rad^2; <= 0: none
  Vector6d claim = Vector6d::Zero();        // of it or of the curvature, what may be handed to a filter; >= 0
  std::array<bool, 6> observable{};
};

class DirectionalInformation {
 public:
  explicit DirectionalInformation(const SurfelConfig& config) : config_(config) {}

  // Hessian: symmetric, of the motion [translation; rotation] about the sensor in map axes.
  Directions analyse(const Matrix6d& hessian, std::span<const Constraint> constraints);

  // The Hessian and gradient with each direction scaled by how far it is observed, 0 to 1.
  void attenuate(const Directions& directions, Matrix6d& hessian, Vector6d& gradient) const;

  // What may be handed to a filter: the claims, nothing along directions without.
  static Matrix6d exported(const Directions& directions);
  // The gradient of the same match that goes with it: -exported^-1 times this is where the match alone would go.
  static Vector6d exported_gradient(const Directions& directions, const Vector6d& gradient);

 private:
  double required(int direction) const;

  SurfelConfig config_;
  std::array<std::array<double, 6>, image_clusters> clusters_;
};

// The six directions for the outside: axes turned into the sensor frame.
Localizability localizability(const Directions& directions, const Eigen::Matrix3d& map_sensor);

}  // namespace adit::lidar_odometry
