#include "components/mapping/registration.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace adit::mapping {
namespace {

// Steps at which it has converged [m, rad]: planes change under the points, smaller ones may never come.
constexpr double settled_m = 2e-3, settled_rad = 1e-4;
constexpr double floor_m = 0.03;
constexpr double lever = 20.0;  // m: turns the floor into one of rotations, 1.5 mrad
// Neighbouring points of one map share its errors: so many count as one.
constexpr double correlated_points = 10.0;

struct Equations {
  Matrix6d hessian = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
  double false_information = 0.0;  // that noisy normals seem to give any direction [1/m^2]
  double squares = 0.0;
  std::size_t inliers = 0, points = 0;
};

Equations linearize(std::span<const Point> cloud, std::size_t stride, const PlaneMap& map, const Pose& pose,
                    const RegistrationConfig& config) {
  Equations e;
  const Eigen::Isometry3f to_map = pose.cast<float>();
  const Eigen::Matrix3d back = pose.linear().transpose();
  const double kernel2 = config.kernel * config.kernel;
  for (std::size_t i = 0; i < cloud.size(); i += stride) {
    ++e.points;
    const Eigen::Vector3f q = to_map * cloud[i].position;
    const Plane* plane = map.nearest(q);
    if (!plane) continue;
    const double r = plane->normal.dot(q - plane->mean);
    if (r * r > 9.0 * kernel2) continue;
    if (r * r < kernel2) {
      ++e.inliers;
      e.squares += r * r;
    }
    const double part = kernel2 / (kernel2 + r * r);
    const double variance = config.residual_sigma * config.residual_sigma + plane->thickness2;
    const double weight = part * part / variance / correlated_points;
    const Eigen::Vector3d n = back * plane->normal.cast<double>();  // in the cloud's frame
    Vector6d j;
    j << n, cloud[i].position.cast<double>().cross(n);
    e.hessian.selfadjointView<Eigen::Lower>().rankUpdate(j, weight);
    e.gradient += weight * r * j;
    e.false_information += weight * (plane->normal_variance + config.normal_bias * config.normal_bias);
  }
  e.hessian = e.hessian.selfadjointView<Eigen::Lower>();
  return e;
}

// Takes from the translation's directions what is false of them.
void report(const Equations& e, Registration& out) {
  const Eigen::Matrix3d rotation = e.hessian.bottomRightCorner<3, 3>() + 1e-6 * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d cross = e.hessian.topRightCorner<3, 3>();
  const Eigen::Matrix3d schur = e.hessian.topLeftCorner<3, 3>() - cross * rotation.ldlt().solve(cross.transpose());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(0.5 * (schur + schur.transpose()));
  Eigen::Vector3d keep;
  double weakest = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double all = std::max(solver.eigenvalues()[i], 1e-12);
    const double rest = std::max(0.0, all - e.false_information);
    keep[i] = std::sqrt(rest / all);
    if (i == 0) weakest = rest;
  }
  Matrix6d shrink = Matrix6d::Identity();
  shrink.topLeftCorner<3, 3>() = solver.eigenvectors() * keep.asDiagonal() * solver.eigenvectors().transpose();
  out.information = shrink * e.hessian * shrink;
  out.information = 0.5 * (out.information + out.information.transpose()).eval();
  out.weakest = solver.eigenvectors().col(0);
  out.weakest_sigma = weakest > 0.0 ? 1.0 / std::sqrt(weakest) : std::numeric_limits<double>::infinity();
  out.overlap = e.points > 0 ? static_cast<double>(e.inliers) / static_cast<double>(e.points) : 0.0;
  out.rms = e.inliers > 0 ? std::sqrt(e.squares / static_cast<double>(e.inliers)) : 0.0;
}

}  // namespace

Matrix6d with_floor(const Matrix6d& information) {
  Vector6d scale;
  scale << Eigen::Vector3d::Ones(), Eigen::Vector3d::Constant(lever);
  const Matrix6d metres = scale.cwiseInverse().asDiagonal() * information * scale.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(metres);
  const Vector6d values = solver.eigenvalues().cwiseMax(0.0);
  const Vector6d limited = values.array() / (1.0 + floor_m * floor_m * values.array());
  const Matrix6d floored = solver.eigenvectors() * limited.asDiagonal() * solver.eigenvectors().transpose();
  const Matrix6d back = scale.asDiagonal() * floored * scale.asDiagonal();
  return 0.5 * (back + back.transpose());
}

Registration align(std::span<const Point> cloud, const PlaneMap& map, const Pose& guess,
                   const RegistrationConfig& config) {
  Registration out;
  out.pose = guess;
  if (cloud.empty() || map.size() == 0 || !guess.matrix().allFinite()) return out;
  const std::size_t stride = std::max<std::size_t>(1, cloud.size() / std::max<std::size_t>(1, config.most_points));
  for (int i = 0; i < config.max_iterations && !out.converged; ++i) {
    const Equations e = linearize(cloud, stride, map, out.pose, config);
    if (e.inliers < 30) return out;  // not enough for six unknowns and doubt
    // Damping by the false information: an axis that only noise observes does not move.
    Matrix6d damped = e.hessian;
    damped.diagonal().head<3>().array() += e.false_information;
    damped.diagonal().tail<3>().array() += 1e-3 * e.hessian.diagonal().tail<3>().array() + 1e-6;
    const Vector6d step = damped.ldlt().solve(-e.gradient);
    if (!step.allFinite()) return out;
    out.pose = out.pose * se3_exp(step);
    out.pose.linear() = orthonormalized(out.pose.linear());
    out.converged = step.head<3>().norm() < settled_m && step.tail<3>().norm() < settled_rad;
  }
  report(linearize(cloud, stride, map, out.pose, config), out);
  return out;
}

}  // namespace adit::mapping
