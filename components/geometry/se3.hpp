// Rigid motions. Notation and formulas: Sola, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics"
// (2018), appendices B and D. Tangent vectors are [rho; theta]: translation part first, metres and radians.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace adit {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Pose = Eigen::Isometry3d;

// The matrix S with S * v == w.cross(v).
Eigen::Matrix3d skew(const Eigen::Vector3d& w);

// Rotation vector (rad) to rotation and back. so3_log returns an angle in [0, pi]. Both are exact to round-off near 0.
Eigen::Matrix3d so3_exp(const Eigen::Vector3d& theta);
Eigen::Vector3d so3_log(const Eigen::Matrix3d& rotation);

// Left Jacobian of SO(3) and its inverse: so3_exp(theta + d) = so3_exp(J_l(theta) d) so3_exp(theta) to first order.
Eigen::Matrix3d so3_left_jacobian(const Eigen::Vector3d& theta);
Eigen::Matrix3d so3_left_jacobian_inverse(const Eigen::Vector3d& theta);

// Twist integrated for unit time, and the twist that reaches a pose in unit time.
Pose se3_exp(const Vector6d& xi);
Vector6d se3_log(const Pose& pose);

// Ad(T): T * exp(xi) * T^-1 = exp(Ad(T) xi).
Matrix6d se3_adjoint(const Pose& pose);

// The pose at `fraction` of the constant-twist motion from `from` to `to` (0: from, 1: to; extrapolates outside).
Pose se3_interpolate(const Pose& from, const Pose& to, double fraction);

// Heading about +z (rad, in (-pi, pi]) of the body x axis: yaw of REP-103.
double yaw(const Eigen::Matrix3d& rotation);
// The same angle in (-pi, pi].
double wrap_angle(double angle);
// Nearest rotation in the Frobenius norm: removes what repeated products accumulate.
Eigen::Matrix3d orthonormalized(const Eigen::Matrix3d& matrix);

}  // namespace adit
