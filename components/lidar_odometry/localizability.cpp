#include "components/lidar_odometry/localizability.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace adit::lidar_odometry {
namespace {

std::array<Direction, 3> directions(const Eigen::Matrix3d& information, double required) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(information);  // ascending
  std::array<Direction, 3> result;
  for (int i = 0; i < 3; ++i) {
    const double value = eigen.eigenvalues()[i];
    Direction& direction = result[static_cast<std::size_t>(i)];
    direction.axis = eigen.eigenvectors().col(i);
    direction.sigma = value > 0.0 ? 1.0 / std::sqrt(value) : std::numeric_limits<double>::infinity();
    direction.observable = direction.sigma < required;
  }
  return result;
}

}  // namespace

Eigen::Matrix3d schur_complement(const Matrix6d& information, int first) {
  const int other = 3 - first;
  const Eigen::Matrix3d own = information.block<3, 3>(first, first);
  const Eigen::Matrix3d cross = information.block<3, 3>(first, other);
  // Directions of the other block that are not observed carry nothing over: pseudo-inverse.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(information.block<3, 3>(other, other));
  const double limit = 1e-12 * std::max(eigen.eigenvalues()[2], 0.0);
  Eigen::Vector3d inverse = Eigen::Vector3d::Zero();
  for (int i = 0; i < 3; ++i) {
    if (eigen.eigenvalues()[i] > limit) inverse[i] = 1.0 / eigen.eigenvalues()[i];
  }
  const Eigen::Matrix3d projected = cross * eigen.eigenvectors();
  const Eigen::Matrix3d result = own - projected * inverse.asDiagonal() * projected.transpose();
  return 0.5 * (result + result.transpose());
}

Localizability localizability(const Matrix6d& information, const LocalizabilityConfig& config) {
  return {directions(schur_complement(information, 0), config.required_translation),
          directions(schur_complement(information, 3), config.required_rotation)};
}

Matrix6d bounded_covariance(const Matrix6d& information) {
  Vector6d floor;
  floor << Eigen::Vector3d::Constant(1e-2), Eigen::Vector3d::Constant(1.0 / (std::numbers::pi * std::numbers::pi));
  Matrix6d bounded = information;
  bounded.diagonal() += floor;
  const Matrix6d covariance = bounded.ldlt().solve(Matrix6d::Identity());
  return 0.5 * (covariance + covariance.transpose());
}

}  // namespace adit::lidar_odometry
