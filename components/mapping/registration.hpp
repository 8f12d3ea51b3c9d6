// Point-to-plane registration of a cloud to planes, with what it really says: the information of the match without the
// axis that only noise of the normals seems to observe (specification of the LiDAR odometry, 5.5: Schur complement of
// the translation, noise floor of the normals).
#pragma once

#include "components/mapping/plane_map.hpp"

namespace adit::mapping {

struct RegistrationConfig {
  double kernel = 0.3;  // m: residuals beyond it count little (Geman-McClure)
  int max_iterations = 30;
  std::size_t most_points = 4000;
  double normal_bias = 0.03;     // rad: error of a normal that more points do not average out
  double residual_sigma = 0.05;  // m: of a point beside its plane, besides the plane's thickness
};

struct Registration {
  bool converged = false;
  Pose pose = Pose::Identity();             // cloud to map
  Matrix6d information = Matrix6d::Zero();  // right perturbation [1/m^2, 1/rad^2]; unobserved directions: zero
  double overlap = 0.0;                     // share of the points that lie within the kernel at a plane
  double rms = 0.0;                         // m, of these
  Eigen::Vector3d weakest = Eigen::Vector3d::UnitX();  // worst observed direction, frame of the cloud
  double weakest_sigma = 0.0;                          // m along it, by the match's own noise; infinity: not observed
};

// Precondition: the guess is within about the kernel plus half a voxel. Deterministic.
Registration align(std::span<const Point> cloud, const PlaneMap& map, const Pose& guess,
                   const RegistrationConfig& config);

// With 3 cm and 1.5 mrad added to its covariance: what clouds and map have in common is not averaged out. Directions
// without information stay without.
Matrix6d with_floor(const Matrix6d& information);

}  // namespace adit::mapping
