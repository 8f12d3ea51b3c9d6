// Which directions a sweep observes, from its information matrix. Translation and rotation are looked at apart, each
// with the other free (Schur complement), so that metres and radians are never compared.
#pragma once

#include "components/lidar_odometry/estimate.hpp"

namespace adit::lidar_odometry {

struct LocalizabilityConfig {
  double required_translation = 0.03;  // m: a direction with a larger sigma is not observable
  double required_rotation = 1.75e-3;  // rad
};

// Precondition: information is symmetric and positive semidefinite up to round-off, [translation; rotation].
Localizability localizability(const Matrix6d& information, const LocalizabilityConfig& config);

// Information about the block [first, first + 3) with the other three unknown.
Eigen::Matrix3d schur_complement(const Matrix6d& information, int first);

// Inverse of the information with the sigma of each direction limited to 10 m and pi rad. Not more: the unobserved axis
// is itself known to some 0.01 degrees only, and a kilometre along it would count as decimetres across it.
Matrix6d bounded_covariance(const Matrix6d& information);

}  // namespace adit::lidar_odometry
