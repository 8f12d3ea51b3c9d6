#include "components/lidar_odometry/directional_information.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <Eigen/Eigenvalues>

#include "components/lidar_odometry/localizability.hpp"

namespace adit::lidar_odometry {
namespace {

// Inverse of a symmetric matrix with directions that it does not know left out.
Eigen::Matrix3d pseudo_inverse(const Eigen::Matrix3d& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(matrix);
  const double limit = 1e-9 * std::max(eigen.eigenvalues()[2], 1e-9);
  Eigen::Vector3d inverse = Eigen::Vector3d::Zero();
  for (int i = 0; i < 3; ++i) {
    if (eigen.eigenvalues()[i] > limit) inverse[i] = 1.0 / eigen.eigenvalues()[i];
  }
  return eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
}

}  // namespace

double DirectionalInformation::required(int direction) const {
  const double sigma = direction < 3 ? config_.required_translation : config_.required_rotation;
  return 1.0 / (sigma * sigma);
}

Directions DirectionalInformation::analyse(const Matrix6d& hessian, std::span<const Constraint> constraints) {
  Directions result;
  const Eigen::Matrix3d rr = hessian.bottomRightCorner<3, 3>();
  const Eigen::Matrix3d rt = hessian.bottomLeftCorner<3, 3>();
  const Eigen::Matrix3d follow = pseudo_inverse(rr) * rt;  // rotation that a translation drags along, negative
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> translation(schur_complement(hessian, 0));
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> rotation(rr);
  const Eigen::Matrix3d& v = translation.eigenvectors();
  const Eigen::Matrix3d& w = rotation.eigenvectors();
  result.basis << v, Eigen::Matrix3d::Zero(), -follow * v, w;
  result.to_coordinates << v.transpose(), Eigen::Matrix3d::Zero(), w.transpose() * follow, w.transpose();
  result.curvature << translation.eigenvalues(), rotation.eigenvalues();

  const Eigen::Matrix<float, 6, 6> basis = result.basis.cast<float>();
  for (auto& cluster : clusters_) cluster.fill(0.0);
  Vector6d bias = Vector6d::Zero();
  for (const Constraint& c : constraints) {
    if (c.weight == 0.0f) continue;
    std::array<double, 6>& cluster = clusters_[c.cluster];
    for (int i = 0; i < 6; ++i) {
      const Eigen::Vector3f moved = basis.col(i).head<3>() + basis.col(i).tail<3>().cross(c.lever);
      const float product = c.map_normal.dot(moved) * c.source_normal.dot(moved);
      cluster[static_cast<std::size_t>(i)] += static_cast<double>(c.weight * product);
      bias[i] += static_cast<double>(c.weight * moved.squaredNorm());
    }
  }
  const double tilt2 = config_.common_tilt * config_.common_tilt;
  for (int i = 0; i < 6; ++i) {
    const double limit = 0.5 * required(i);
    double sum = 0.0, squares = 0.0;
    double all = 0.0, all_squares = 0.0;  // not limited
    for (const auto& cluster : clusters_) {
      const double value = cluster[static_cast<std::size_t>(i)];
      const double limited = std::clamp(value, -limit, limit);
      all += value;
      all_squares += value * value;
      sum += limited;
      squares += limited * limited;
    }
    result.information[i] = sum - tilt2 * bias[i] - 2.0 * std::sqrt(squares);
    const bool observable = result.information[i] >= required(i);
    result.observable[static_cast<std::size_t>(i)] = observable;
    // The limits are for the question whether a direction is observed. How well one is that is, they would understate
    // tenfold. Two standard errors still go off: evidence in four parts of the image or fewer is worth no more.
    const double whole = all - tilt2 * bias[i] - 2.0 * std::sqrt(all_squares);
    const double claim = observable ? std::max(result.information[i], whole) : result.information[i];
    result.claim[i] = std::clamp(claim, 0.0, std::max(result.curvature[i], 0.0));
  }
  return result;
}

void DirectionalInformation::attenuate(const Directions& directions, Matrix6d& hessian, Vector6d& gradient) const {
  Vector6d scale;
  for (int i = 0; i < 6; ++i) scale[i] = std::clamp(directions.information[i] / required(i), 0.0, 1.0);
  // The Hessian may be a later one than that of the directions: with other robust weights, many times stiffer.
  const Vector6d root = scale.cwiseSqrt();
  const Matrix6d along = directions.basis.transpose() * hessian * directions.basis;
  const Matrix6d& back = directions.to_coordinates;
  hessian = back.transpose() * (root.asDiagonal() * along * root.asDiagonal()) * back;
  gradient = back.transpose() * scale.cwiseProduct(directions.basis.transpose() * gradient);
}

Matrix6d DirectionalInformation::exported(const Directions& directions) {
  const Matrix6d& back = directions.to_coordinates;
  const Matrix6d result = back.transpose() * directions.claim.asDiagonal() * back;
  return 0.5 * (result + result.transpose());
}

Localizability localizability(const Directions& directions, const Eigen::Matrix3d& map_sensor) {
  Localizability result;
  for (int block = 0; block < 2; ++block) {
    std::array<int, 3> order{3 * block, 3 * block + 1, 3 * block + 2};
    std::sort(order.begin(), order.end(),
              [&](int a, int b) { return directions.information[a] < directions.information[b]; });
    auto& out = block == 0 ? result.translation : result.rotation;
    for (std::size_t i = 0; i < 3; ++i) {
      const int k = order[i];
      const double information = directions.information[k];
      out[i].axis = map_sensor.transpose() * directions.basis.col(k).segment<3>(3 * block);
      out[i].sigma = information > 0.0 ? 1.0 / std::sqrt(information) : std::numeric_limits<double>::infinity();
      out[i].observable = directions.observable[static_cast<std::size_t>(k)];
    }
  }
  return result;
}

Vector6d DirectionalInformation::exported_gradient(const Directions& directions, const Vector6d& gradient) {
  Vector6d along = directions.basis.transpose() * gradient;
  for (int i = 0; i < 6; ++i) {
    along[i] = directions.claim[i] > 0.0 ? along[i] * directions.claim[i] / directions.curvature[i] : 0.0;
  }
  return directions.to_coordinates.transpose() * along;
}

}  // namespace adit::lidar_odometry
