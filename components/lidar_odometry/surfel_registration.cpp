#include "components/lidar_odometry/surfel_registration.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace adit::lidar_odometry {
namespace {

constexpr int usual_associations = 3;
constexpr int max_associations = 10;     // while the pose still moves by more than settled_step
constexpr double settled_step = 2e-2;    // m
constexpr int max_solves = 3;            // for each association
constexpr double converged_step = 5e-4;  // m
constexpr double mean_range = 10.0;      // m: turns radians into metres for the stop test
constexpr float max_normal_angle_cosine = 0.96f;

}  // namespace

void SurfelRegistration::compensate(std::span<const Surfel> surfels, const SweepTwist& twist, const Pose& estimate,
                                    WorkerPool& pool) {
  SweepMotion motion;
  if (twist.times) {
    Vector6d xi = twist.predicted;
    if (twist.dt > 0.0 && (twist.translation_share > 0.0 || twist.rotation_share > 0.0)) {
      const Vector6d estimated = se3_log(twist.last.inverse() * estimate) / twist.dt;
      xi.head<3>() += twist.translation_share * (estimated - xi).head<3>();
      xi.tail<3>() += twist.rotation_share * (estimated - xi).tail<3>();
    }
    motion = SweepMotion(xi, *twist.times, twist.reference_time);
  }
  compensated_.resize(surfels.size());
  pool.run((surfels.size() + chunk_size - 1) / chunk_size, [&](std::size_t k) {
    const std::size_t end = std::min((k + 1) * chunk_size, surfels.size());
    for (std::size_t i = k * chunk_size; i < end; ++i) {
      compensated_[i] = surfels[i];
      if (!motion.moving()) continue;
      const SweepMotion::Affine pose = motion.at(static_cast<double>(surfels[i].time));
      const Eigen::Matrix<float, 3, 4> single = pose.cast<float>();
      compensated_[i].point = single.leftCols<3>() * surfels[i].point + single.col(3);
      compensated_[i].normal = single.leftCols<3>() * surfels[i].normal;
    }
  });
}

void SurfelRegistration::associate(const SurfelMap& map, const Pose& pose, double gate, WorkerPool& pool) {
  const std::size_t n = compensated_.size();
  matches_.resize(n);
  const Eigen::Matrix3f rotation = pose.linear().cast<float>();
  const auto max_residual = static_cast<float>(gate);
  pool.run((n + chunk_size - 1) / chunk_size, [&](std::size_t k) {
    const std::size_t end = std::min((k + 1) * chunk_size, n);
    for (std::size_t i = k * chunk_size; i < end; ++i) {
      Match& match = matches_[i];
      match.variance = -1.0f;
      const Eigen::Vector3d q = pose * compensated_[i].point.cast<double>();
      const Eigen::Vector3f source_normal = rotation * compensated_[i].normal;
      const Cell own = map.cell_at(q);
      if (!within_grid(own - Cell::Ones()) || !within_grid(own + Cell::Ones())) continue;
      const Eigen::Vector3d centre = map.centre(own);
      const Eigen::Vector3d inside = q - centre;
      // The own cell, then the three neighbours that the point is nearest to.
      for (int candidate = 0; candidate < 4; ++candidate) {
        Cell cell = own;
        if (candidate > 0) cell[candidate - 1] += inside[candidate - 1] < 0.0 ? -1 : 1;
        const SurfelMap::Index index = map.find(cell);
        if (index == SurfelMap::none) continue;
        const SurfelMap::Plane& plane = map.plane(index);
        if (plane.variance < 0.0f || plane.normal.dot(source_normal) < max_normal_angle_cosine) continue;
        const Eigen::Vector3d mean = map.centre(cell) + plane.mean.cast<double>();
        const Eigen::Vector3f e = (q - mean).cast<float>();
        const float residual = 0.5f * (plane.normal.dot(e) - plane.offset + source_normal.dot(e));
        if (std::abs(residual) > max_residual) continue;
        match = {mean, plane.normal, plane.offset, plane.variance, residual};
        break;
      }
    }
  });
}

double SurfelRegistration::median_residual() {
  residuals_.clear();
  for (const Match& match : matches_) {
    if (match.variance >= 0.0f) residuals_.push_back(std::abs(match.residual));
  }
  if (residuals_.empty()) return 0.0;
  const auto middle = residuals_.begin() + static_cast<std::ptrdiff_t>(residuals_.size() / 2);
  std::nth_element(residuals_.begin(), middle, residuals_.end());
  return static_cast<double>(*middle);
}

void SurfelRegistration::accumulate(const Pose& pose, std::size_t begin, std::size_t end, double kernel, Sums& sums) {
  Eigen::Matrix<double, 6, 6> hessian = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
  sums.weight = sums.squared = 0.0;
  const Eigen::Matrix3f rotation = pose.linear().cast<float>();
  const double noise2 = config_.residual_sigma * config_.residual_sigma;
  const double kernel2 = kernel * kernel;
  for (std::size_t i = begin; i < end; ++i) {
    Constraint& constraint = constraints_[i];
    constraint.weight = 0.0f;
    const Match& match = matches_[i];
    if (match.variance < 0.0f) continue;
    const Eigen::Vector3f y = rotation * compensated_[i].point;
    const Eigen::Vector3f n_s = rotation * compensated_[i].normal;
    const Eigen::Vector3f& n_m = match.normal;
    const Eigen::Vector3f e = (pose.translation() - match.mean).cast<float>() + y;
    const float r_m = n_m.dot(e) - match.offset;
    const float r_s = n_s.dot(e);
    const double r = 0.5 * static_cast<double>(r_m + r_s);
    const double k = kernel2 / (kernel2 + r * r);
    const double weight = k * k / ((noise2 + static_cast<double>(match.variance)) * scale_ * scale_);
    const auto w = static_cast<float>(weight);
    constraint = {y, n_m, n_s, w, compensated_[i].cluster};
    Eigen::Matrix<float, 6, 1> j_m, j_s;
    j_m << n_m, y.cross(n_m);
    j_s << n_s, y.cross(n_s);
    const Eigen::Matrix<float, 6, 1> a = (0.5f * w) * j_m;
    const Eigen::Matrix<float, 6, 6> half = a * j_s.transpose();
    hessian += (half + half.transpose()).cast<double>();
    gradient += (a * r_s + (0.5f * w * r_m) * j_s).cast<double>();
    sums.weight += weight;
    sums.squared += weight * r * r;
  }
  sums.hessian = hessian;
  sums.gradient = gradient;
}

SurfelRegistration::Sums SurfelRegistration::linearise(const Pose& pose, double kernel, WorkerPool& pool) {
  const std::size_t n = compensated_.size();
  const std::size_t chunk_count = (n + chunk_size - 1) / chunk_size;
  constraints_.resize(n);
  if (chunks_.size() < chunk_count) chunks_.resize(chunk_count);
  pool.run(chunk_count, [&](std::size_t k) {
    accumulate(pose, k * chunk_size, std::min((k + 1) * chunk_size, n), kernel, chunks_[k]);
  });
  Sums total{Matrix6d::Zero(), Vector6d::Zero(), 0.0, 0.0};
  for (std::size_t k = 0; k < chunk_count; ++k) {
    total.hessian += chunks_[k].hessian;
    total.gradient += chunks_[k].gradient;
    total.weight += chunks_[k].weight;
    total.squared += chunks_[k].squared;
  }
  return total;
}

SurfelRegistrationResult SurfelRegistration::align(std::span<const Surfel> surfels, const SurfelMap& map,
                                                   const Pose& guess, const SurfelPrior& prior, const SweepTwist& twist,
                                                   double gate, std::size_t min_matches, WorkerPool& pool) {
  SurfelRegistrationResult result;
  result.pose = guess;
  Pose pose = guess;
  double moved = 0.0;  // m, by the last association
  for (int outer = 0; outer < usual_associations || (outer < max_associations && moved > settled_step); ++outer) {
    moved = 0.0;
    compensate(surfels, twist, pose, pool);
    associate(map, pose, gate, pool);
    ++result.associations;
    result.median_residual = median_residual();
    result.matched = residuals_.size();
    if (result.matched < min_matches) return result;
    const double deviation = 1.4826 * result.median_residual;
    const double kernel = std::max(config_.residual_sigma, 3.0 * result.median_residual);
    scale_ = std::max(deviation / config_.residual_sigma, 0.5);
    for (int inner = 0; inner < max_solves; ++inner) {
      Sums sums = linearise(pose, kernel, pool);
      result.rms_residual = std::sqrt(sums.squared / std::max(sums.weight, 1e-12));
      if (inner == 0) result.directions = information_.analyse(sums.hessian, constraints_);
      const Matrix6d match_hessian = sums.hessian;
      const Vector6d match_gradient = sums.gradient;
      if (prior.decides_weak_directions) information_.attenuate(result.directions, sums.hessian, sums.gradient);
      Vector6d error;
      error << pose.translation() - prior.pose.translation(), so3_log(pose.linear() * prior.pose.linear().transpose());
      const Matrix6d hessian = sums.hessian + prior.information;
      const Vector6d gradient = sums.gradient + prior.information * error;
      const Vector6d step = hessian.ldlt().solve(-gradient);
      ++result.solves;
      if (!step.allFinite() || step.head<3>().norm() > 10.0 || step.tail<3>().norm() > 1.0) {
        result.matched = 0;
        return result;
      }
      result.gradient = match_gradient + match_hessian * step;
      pose.translation() += step.head<3>();
      pose.linear() = orthonormalized(so3_exp(step.tail<3>()) * pose.linear());
      const double length = step.head<3>().norm() + mean_range * step.tail<3>().norm();
      moved += length;
      if (length < converged_step) break;
    }
  }
  result.pose = pose;
  place(surfels, pose, twist);
  return result;
}

std::span<const MapSurfel> SurfelRegistration::place(std::span<const Surfel> surfels, const Pose& pose,
                                                     const SweepTwist& twist) {
  WorkerPool alone(1);
  compensate(surfels, twist, pose, alone);
  placed_.resize(surfels.size());
  const Eigen::Matrix3f rotation = pose.linear().cast<float>();
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    placed_[i] = {pose * compensated_[i].point.cast<double>(), rotation * compensated_[i].normal};
  }
  return placed_;
}

}  // namespace adit::lidar_odometry
