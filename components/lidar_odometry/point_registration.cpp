#include "components/lidar_odometry/point_registration.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace adit::lidar_odometry {
namespace {

constexpr int non_planar = 0;
constexpr int planar = 1;

// Geman-McClure weight on the squared norm of a residual, in the form of the published code (KISS-ICP, eq. (9)).
double robust_weight(double squared, double kernel) {
  const double k = kernel / (kernel + squared);
  return k * k;
}

}  // namespace

void PointRegistration::Sums::clear() {
  for (int kind : {non_planar, planar}) {
    hessian[kind].setZero();
    gradient[kind].setZero();
    count[kind] = 0;
  }
  weight = squared = 0.0;
}

void PointRegistration::Sums::add(const Sums& other) {
  for (int kind : {non_planar, planar}) {
    hessian[kind] += other.hessian[kind];
    gradient[kind] += other.gradient[kind];
    count[kind] += other.count[kind];
  }
  weight += other.weight;
  squared += other.squared;
}

bool PointRegistration::fit_plane(const NeighbourhoodStatistics& statistics, Eigen::Vector3d& normal) const {
  if (statistics.count < config_.min_neighbours) return false;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(statistics.covariance);
  normal = eigen.eigenvectors().col(0);
  return eigen.eigenvalues()[0] < config_.planarity * statistics.covariance.trace();
}

void PointRegistration::accumulate(std::span<const Eigen::Vector3d> points, const PointMap& map, const Pose& pose,
                                   double max_distance, double kernel, Sums& sums) const {
  sums.clear();
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d q = pose * point;
    Neighbourhood near;
    if (config_.planar) {
      const NeighbourhoodStatistics statistics = map.statistics(q, max_distance);
      Eigen::Vector3d normal;
      if (statistics.found && fit_plane(statistics, normal)) {
        const double residual = normal.dot(q - statistics.nearest);
        Vector6d jacobian;  // of a left perturbation of the pose
        jacobian << normal, q.cross(normal);
        const double weight = robust_weight(residual * residual, kernel);
        sums.hessian[planar].noalias() += weight * jacobian * jacobian.transpose();
        sums.gradient[planar] += weight * residual * jacobian;
        ++sums.count[planar];
        sums.weight += weight;
        sums.squared += weight * residual * residual;
        continue;
      }
      near = statistics;
    } else {
      near = map.nearest(q, max_distance);
    }
    if (!near.found) continue;
    const Eigen::Vector3d residual = q - near.nearest;
    const double weight = robust_weight(residual.squaredNorm(), kernel);
    // J = [I, -[q]x]: the products are written out, most of the 6x6 is structure.
    const Eigen::Matrix3d s = skew(q);
    Matrix6d& hessian = sums.hessian[non_planar];
    hessian.topLeftCorner<3, 3>().diagonal().array() += weight;
    hessian.topRightCorner<3, 3>() -= weight * s;
    hessian.bottomRightCorner<3, 3>().noalias() -= weight * (s * s);
    sums.gradient[non_planar].head<3>() += weight * residual;
    sums.gradient[non_planar].tail<3>() += weight * q.cross(residual);
    ++sums.count[non_planar];
    sums.weight += 3.0 * weight;
    sums.squared += weight * residual.squaredNorm();
  }
  sums.hessian[non_planar].bottomLeftCorner<3, 3>() = sums.hessian[non_planar].topRightCorner<3, 3>().transpose();
}

PointRegistrationResult PointRegistration::align(std::span<const Eigen::Vector3d> points, const PointMap& map,
                                                 const Pose& guess, double max_distance, double kernel,
                                                 const PosePrior& prior, WorkerPool& pool) {
  PointRegistrationResult result;
  result.pose = guess;
  const std::size_t chunk_count = (points.size() + chunk_size - 1) / chunk_size;
  if (chunks_.size() < chunk_count) chunks_.resize(chunk_count);
  const bool use_prior = !prior.information.isZero(0.0);
  Sums sums;
  while (result.iterations < config_.max_iterations) {
    pool.run(chunk_count, [&](std::size_t i) {
      const std::size_t begin = i * chunk_size;
      accumulate(points.subspan(begin, std::min(chunk_size, points.size() - begin)), map, result.pose, max_distance,
                 kernel, chunks_[i]);
    });
    sums.clear();
    for (std::size_t i = 0; i < chunk_count; ++i) sums.add(chunks_[i]);
    result.matched = sums.count[planar] + sums.count[non_planar];
    result.planar = sums.count[planar];
    if (result.matched == 0) {
      result.solvable = false;
      break;
    }
    // GenZ-ICP, eq. (9)-(11): both kinds, each with the other's absence as weight. KISS-ICP has one kind: alpha is 0.
    const double alpha = static_cast<double>(result.planar) / static_cast<double>(result.matched);
    result.hessian = alpha * sums.hessian[planar] + (1.0 - alpha) * sums.hessian[non_planar];
    Vector6d gradient = alpha * sums.gradient[planar] + (1.0 - alpha) * sums.gradient[non_planar];
    result.rms_residual = std::sqrt(sums.squared / sums.weight);
    Matrix6d hessian = result.hessian;
    if (use_prior) {
      // Residual Log(T_prior^-1 T) of the right perturbation, brought to the left one: d(xi_right) = Ad(T^-1)
      // d(xi_left). Residuals of the match are in metres; its scale makes both terms comparable.
      const double variance = std::max(result.rms_residual * result.rms_residual, 1e-4);
      const Matrix6d adjoint = se3_adjoint(result.pose.inverse());
      const Vector6d error = se3_log(prior.pose.inverse() * result.pose);
      hessian += variance * adjoint.transpose() * prior.information * adjoint;
      gradient += variance * adjoint.transpose() * (prior.information * error);
    }
    const Vector6d step = hessian.ldlt().solve(-gradient);
    if (!step.allFinite() || step.norm() > 1e3) {
      result.solvable = false;
      break;
    }
    result.pose = se3_exp(step) * result.pose;
    result.pose.linear() = orthonormalized(result.pose.linear());
    ++result.iterations;
    if (step.norm() < config_.convergence) {
      result.converged = true;
      break;
    }
  }
  if (!result.solvable) result.pose = guess;
  const Matrix6d adjoint = se3_adjoint(result.pose);
  result.hessian = adjoint.transpose() * result.hessian * adjoint;
  return result;
}

}  // namespace adit::lidar_odometry
