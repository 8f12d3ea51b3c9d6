#include "components/lidar_odometry/point_odometry.hpp"

#include <algorithm>
#include <cmath>

#include "components/lidar_odometry/localizability.hpp"

namespace adit::lidar_odometry {
namespace {

double map_voxel(const Config& config) {
  if (config.mode == Mode::genz) return config.genz.voxel_size;
  return config.kiss.voxel_size > 0.0 ? config.kiss.voxel_size : config.max_range / 100.0;
}

AdaptiveThreshold make_threshold(const Config& config) {
  if (config.mode == Mode::genz) {
    return {AdaptiveThreshold::Rule::genz, config.genz.initial_threshold, config.genz.min_motion, config.max_range};
  }
  return {AdaptiveThreshold::Rule::kiss, config.kiss.initial_threshold, config.kiss.min_motion, config.max_range};
}

PointMap make_map(const Config& config) {
  const double voxel = map_voxel(config);
  if (config.mode == Mode::genz) return {voxel, config.genz.max_points_per_voxel, 0.0};
  const std::size_t count = config.kiss.max_points_per_voxel;
  return {voxel, count, std::sqrt(voxel * voxel / static_cast<double>(count))};
}

PointRegistrationConfig make_registration(const Config& config) {
  PointRegistrationConfig registration;
  registration.planar = config.mode == Mode::genz;
  registration.planarity = config.genz.planarity;
  registration.max_iterations = registration.planar ? config.genz.max_iterations : config.kiss.max_iterations;
  registration.convergence = registration.planar ? config.genz.convergence : config.kiss.convergence;
  return registration;
}

}  // namespace

PointOdometry::PointOdometry(const Config& config, WorkerPool& pool)
    : config_(config),
      genz_(config.mode == Mode::genz),
      pool_(pool),
      threshold_(make_threshold(config)),
      map_(make_map(config)),
      registration_(make_registration(config)),
      scan_voxel_(map_voxel(config)) {}

void PointOdometry::reset() {
  threshold_.reset();
  map_.clear();
  scan_voxel_ = map_voxel(config_);
}

void PointOdometry::select_points() {
  if (genz_) {
    // One step towards the desired number of points, with the count at the last voxel size (GenZ-ICP, section III-B).
    downsample(points_, scan_voxel_, filter_, registration_points_);
    const double ratio =
        static_cast<double>(registration_points_.size()) / static_cast<double>(config_.genz.desired_points);
    scan_voxel_ = std::clamp(scan_voxel_ * ratio, 0.02, 2.0);
    downsample(points_, std::max(0.5 * scan_voxel_, 0.02), filter_, map_points_);
    downsample(map_points_, scan_voxel_, filter_, registration_points_);
  } else {
    const double voxel = map_voxel(config_);
    downsample(points_, 0.5 * voxel, filter_, map_points_);
    downsample(map_points_, 1.5 * voxel, filter_, registration_points_);
  }
}

void PointOdometry::process(const SweepTask& task, Estimate& estimate) {
  SweepMotion motion = task.sampled;
  if (config_.deskew && task.times && !motion.moving())
    motion = SweepMotion(task.twist, *task.times, task.reference_time);
  read_points(task.cloud, motion, config_.min_range, config_.max_range, points_, estimate.scan);
  estimate.pose = task.prediction;
  if (points_.size() < config_.min_points) {
    estimate.status = Status::too_few_points;
    return;
  }
  select_points();
  estimate.scan.registered = static_cast<std::uint32_t>(registration_points_.size());

  if (map_.empty()) {
    estimate.status = Status::initialising;
    start_ = task.prediction.translation();
  } else {
    const double sigma = threshold_.sigma((task.last.translation() - start_).norm());
    const PointRegistrationResult result =
        registration_.align(registration_points_, map_, task.prediction, 3.0 * sigma, genz_ ? sigma / 3.0 : sigma,
                            {task.prediction, task.information}, pool_);
    estimate.scan.matched = static_cast<std::uint32_t>(result.matched);
    estimate.scan.associations = estimate.scan.solves = static_cast<std::uint32_t>(result.iterations);
    estimate.scan.iteration_cap = !result.converged;
    estimate.scan.rms_residual = result.rms_residual;
    estimate.scan.planar_ratio =
        result.matched > 0 ? static_cast<double>(result.planar) / static_cast<double>(result.matched) : 0.0;
    const std::size_t needed = std::max<std::size_t>(10, registration_points_.size() / 10);
    if (!result.solvable || result.matched < needed) {
      estimate.status = Status::lost;
      return;
    }
    threshold_.add(task.prediction, result.pose);
    estimate.status = Status::ok;
    estimate.pose = result.pose;
    // Residuals of nearby points are alike (one wall, one map cell), so the sum counts them several times over.
    constexpr double points_per_independent_one = 16.0;
    const double variance = std::max(result.rms_residual, 0.02) * std::max(result.rms_residual, 0.02);
    estimate.information = result.hessian / (variance * points_per_independent_one);
    estimate.localizability = localizability(estimate.information, {});
  }

  for (Eigen::Vector3d& point : map_points_) point = estimate.pose * point;
  map_.add(map_points_);
  map_.remove_far(estimate.pose.translation(), config_.max_range);
  estimate.scan.map_cells = static_cast<std::uint32_t>(map_.cells());
}

}  // namespace adit::lidar_odometry
