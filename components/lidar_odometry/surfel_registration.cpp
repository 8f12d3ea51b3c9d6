#include "components/lidar_odometry/surfel_registration.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace adit::lidar_odometry {
namespace {

constexpr int usual_associations = 3;
constexpr int max_associations = 10;     // while the pose still moves by more than settled_step
constexpr double settled_step = 2e-2;    // m
constexpr int max_solves = 3;            // for each of the first two associations; one less for later ones
constexpr double converged_step = 5e-4;  // m
constexpr double mean_range = 10.0;      // m: turns radians into metres for the stop test
constexpr float max_normal_angle_cosine = 0.96f;

}  // namespace

SweepMotion SweepTwist::motion(const Vector6d& twist) const {
  if (!times) return {};
  if (sampled == nullptr) return {twist, *times, reference_time};
  const Eigen::Vector3d correction = twist.head<3>() - predicted.head<3>();
  return correction.isZero(0.0) ? *sampled : sampled->with_velocity(correction);
}

Pose SweepTwist::middle(const Pose& pose, const Vector6d& twist) const {
  if (!times) return pose;
  const double time = 0.5 * (times->first + times->last);
  if (sampled == nullptr) return pose * se3_exp((time - reference_time) * twist);
  Pose within = Pose::Identity();
  within.matrix().topRows<3>() = motion(twist).at(time);
  return pose * within;
}

Vector6d SweepTwist::refined(const Pose& pose, const Vector6d& used) const {
  if (!(dt > 0.0)) return used;
  Vector6d twist = predicted;
  if (sampled != nullptr && expected_way) {
    const Eigen::Vector3d way = middle(pose, used).translation() - last_middle.translation();
    twist.head<3>() += translation_share / dt * (pose.linear().transpose() * (way - *expected_way));
    return twist;
  }
  if (sampled != nullptr) {
    twist.head<3>() += translation_share / dt * (prediction.inverse() * pose).translation();
    return twist;
  }
  const Vector6d between = se3_log(last_middle.inverse() * middle(pose, used)) / dt;
  Eigen::Vector3d rate = between.tail<3>();
  if (!rotation_from_middles) rate = so3_log(last.linear().transpose() * pose.linear()) / dt;
  twist.head<3>() += translation_share * (between.head<3>() - predicted.head<3>());
  twist.tail<3>() += rotation_share * (rate - predicted.tail<3>());
  return twist;
}

void SurfelRegistration::compensate(std::span<const Surfel> surfels, const SweepTwist& sweep, const Vector6d& twist,
                                    WorkerPool& pool) {
  const SweepMotion motion = sweep.motion(twist);
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
  // Rows 6 and 7 are padding: columns of whole packets.
  Eigen::Matrix<float, 8, 6> hessian = Eigen::Matrix<float, 8, 6>::Zero();
  Eigen::Matrix<float, 8, 1> gradient = Eigen::Matrix<float, 8, 1>::Zero();
  Eigen::Matrix<float, 8, 1> j = Eigen::Matrix<float, 8, 1>::Zero();
  float weights = 0.0f;
  float squares = 0.0f;
  const Eigen::Matrix3f rotation = pose.linear().cast<float>();
  const auto noise2 = static_cast<float>(config_.residual_sigma * config_.residual_sigma);
  const auto kernel2 = static_cast<float>(kernel * kernel);
  const auto scale2 = static_cast<float>(scale_ * scale_);
  const auto reference = static_cast<float>(reference_time_);
  for (std::size_t i = begin; i < end; ++i) {
    Constraint& constraint = constraints_[i];
    constraint.weight = 0.0f;
    const Match& match = matches_[i];
    if (match.variance < 0.0f) continue;
    const Eigen::Vector3f y = rotation * compensated_[i].point;
    const Eigen::Vector3f n_s = rotation * compensated_[i].normal;
    const Eigen::Vector3f& n_m = match.normal;
    const Eigen::Vector3f e = (pose.translation() - match.mean).cast<float>() + y;
    const Eigen::Vector3f n = 0.5f * (n_m + n_s);
    const float r = n.dot(e) - 0.5f * match.offset;
    const float k = kernel2 / (kernel2 + r * r);
    const float w = k * k / ((noise2 + match.variance) * scale2);
    constraint = {y, n_m, n_s, w, compensated_[i].cluster, compensated_[i].time - reference};
    j.head<3>() = n;
    j.segment<3>(3) = y.cross(n);
    const Eigen::Matrix<float, 8, 1> a = w * j;
    for (int column = 0; column < 6; ++column) hessian.col(column) += j[column] * a;
    gradient += r * a;
    weights += w;
    squares += w * r * r;
  }
  sums.hessian = hessian.topRows<6>().cast<double>();
  sums.gradient = gradient.head<6>().cast<double>();
  sums.weight = static_cast<double>(weights);
  sums.squared = static_cast<double>(squares);
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
                                                   const Pose& guess, const SurfelPrior& prior, const SweepTwist& sweep,
                                                   double gate, std::size_t min_matches, WorkerPool& pool) {
  SurfelRegistrationResult result;
  result.pose = guess;
  result.twist = sweep.predicted;
  Pose pose = guess;
  double moved = 0.0;  // m, by the last association
  Matrix6d last_hessian = Matrix6d::Zero();
  reference_time_ = sweep.times ? sweep.reference_time : 0.0;
  for (int outer = 0; outer < usual_associations || (outer < max_associations && moved > settled_step); ++outer) {
    moved = 0.0;
    if (result.associations > 0) result.twist = sweep.refined(pose, result.twist);
    compensate(surfels, sweep, result.twist, pool);
    associate(map, pose, gate, pool);
    ++result.associations;
    result.median_residual = median_residual();
    result.matched = residuals_.size();
    if (result.matched < min_matches) return result;
    const double deviation = 1.4826 * result.median_residual;
    const double kernel = std::max(config_.residual_sigma, 3.0 * result.median_residual);
    scale_ = std::max(deviation / config_.residual_sigma, 0.5);
    for (int inner = 0; inner < (outer < 2 ? max_solves : max_solves - 1); ++inner) {
      Sums sums = linearise(pose, kernel, pool);
      result.rms_residual = std::sqrt(sums.squared / std::max(sums.weight, 1e-12));
      if (inner == 0) result.directions = information_.analyse(sums.hessian, constraints_);
      const Matrix6d match_hessian = sums.hessian;
      last_hessian = match_hessian;
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
  place(pose);
  result.lag = lag(last_hessian);
  return result;
}

// A twist of `t` moves a point of time s after the pose's instant by s times what a motion t of the pose would move it
// by. So the residuals change by s J t, and the solution by -H^-1 sum(w J s J^T) t.
Matrix6d SurfelRegistration::lag(const Matrix6d& hessian) const {
  Matrix6d total = Matrix6d::Zero();
  for (std::size_t begin = 0; begin < constraints_.size(); begin += chunk_size) {
    Eigen::Matrix<float, 8, 6> sum = Eigen::Matrix<float, 8, 6>::Zero();
    Eigen::Matrix<float, 8, 1> j = Eigen::Matrix<float, 8, 1>::Zero();
    for (std::size_t i = begin; i < std::min(begin + chunk_size, constraints_.size()); ++i) {
      const Constraint& c = constraints_[i];
      if (c.weight == 0.0f) continue;
      const Eigen::Vector3f n = 0.5f * (c.map_normal + c.source_normal);
      j.head<3>() = n;
      j.segment<3>(3) = c.lever.cross(n);
      const Eigen::Matrix<float, 8, 1> a = -c.time * c.weight * j;
      for (int column = 0; column < 6; ++column) sum.col(column) += j[column] * a;
    }
    total += sum.topRows<6>().cast<double>();
  }
  Matrix6d regular = hessian;
  regular.diagonal() += open_information();
  return regular.ldlt().solve(total);
}

void SurfelRegistration::place(const Pose& pose) {
  placed_.resize(compensated_.size());
  const Eigen::Matrix3f rotation = pose.linear().cast<float>();
  for (std::size_t i = 0; i < compensated_.size(); ++i) {
    placed_[i] = {pose * compensated_[i].point.cast<double>(), rotation * compensated_[i].normal};
  }
}

std::span<const MapSurfel> SurfelRegistration::place(std::span<const Surfel> surfels, const Pose& pose,
                                                     const SweepTwist& sweep, const Vector6d& twist) {
  WorkerPool alone(1);
  compensate(surfels, sweep, twist, alone);
  place(pose);
  return placed_;
}

}  // namespace adit::lidar_odometry
