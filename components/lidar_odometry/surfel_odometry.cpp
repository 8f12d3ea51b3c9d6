#include "components/lidar_odometry/surfel_odometry.hpp"

#include <algorithm>
#include <cmath>

namespace adit::lidar_odometry {
namespace {

constexpr int wide_gate_sweeps = 5;  // after the start: the map is thin and the velocity new
constexpr double wide_gate = 0.5;    // m
constexpr double gate = 0.2;         // m

// Where the vehicle may be at the second sweep if it was already moving at the first.
constexpr double start_shift_step = 0.4;                         // m, along the sensor's x
constexpr int start_shifts = 5;                                  // to either side: 20 m/s at 10 Hz
constexpr double start_translation = 2.0, start_rotation = 0.2;  // m and rad, sigma of that prior
constexpr int start_rounds = 3;       // of undistorting the first two sweeps with the velocity between them
constexpr double settled_way = 2e-3;  // m, by which half a sweep's motion changed in the last round
constexpr double mean_range = 10.0;   // m: turns radians into metres for that
constexpr int lasting_changes = 5;    // of the twist, that its mean square is of

Matrix6d start_information() {
  Matrix6d information = Matrix6d::Zero();
  information.diagonal() << Eigen::Vector3d::Constant(1.0 / (start_translation * start_translation)),
      Eigen::Vector3d::Constant(1.0 / (start_rotation * start_rotation));
  return information;
}

bool translation_observable(const Directions& directions) {
  return directions.observable[0] && directions.observable[1] && directions.observable[2];
}

}  // namespace

SurfelOdometry::SurfelOdometry(const Config& config, WorkerPool& pool)
    : config_(config),
      pool_(pool),
      extractor_(config),
      map_(config.surfel.cell_size, config.surfel.map_radius, config.surfel.max_cells),
      registration_(config.surfel) {}

void SurfelOdometry::reset() {
  map_.clear();
  sweeps_ = 0;
  last_median_ = 0.0;
  last_twist_.reset();
  twist_changes_ = 0;
  redo_first_ = false;
}

// Without a prior from outside: the velocity stays, within what the vehicle's acceleration can change in dt. With one:
// directions that it does not know keep their velocity, too, but loosely: beside a prior that does know, the assumption
// of a constant velocity would only lag.
SurfelPrior SurfelOdometry::prior_of(const SweepTask& task) const {
  const double dt2 = std::clamp(task.dt * task.dt, 1e-6, 1.0);
  const double translation = config_.surfel.max_acceleration * dt2;
  const double rotation = config_.surfel.max_angular_acceleration * dt2;
  Vector6d diagonal;
  diagonal << Eigen::Vector3d::Constant(1.0 / (translation * translation)),
      Eigen::Vector3d::Constant(1.0 / (rotation * rotation));
  SurfelPrior prior;
  prior.pose = task.prediction;
  if (task.information.isZero(0.0)) {
    prior.information = diagonal.asDiagonal();
    return prior;
  }
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = task.prediction.linear();
  prior.information = turn * task.information * turn.transpose();
  if (task.coasting && !task.sampled.moving()) {
    Vector6d apart;
    apart << task.coasting->translation() - task.prediction.translation(),
        so3_log(task.coasting->linear() * task.prediction.linear().transpose());
    diagonal *= 1e-2;
    prior.information.diagonal() += diagonal;
    const Vector6d step = prior.information.ldlt().solve(diagonal.cwiseProduct(apart));
    prior.pose.translation() += step.head<3>();
    prior.pose.linear() = orthonormalized(so3_exp(step.tail<3>()) * prior.pose.linear());
    return prior;
  }
  prior.information.diagonal() += open_information();
  return prior;
}

SweepTwist SurfelOdometry::twist_of(const SweepTask& task) const {
  SweepTwist twist;
  if (!config_.deskew || !task.times) return twist;
  twist.times = task.times;
  twist.reference_time = task.reference_time;
  twist.last = task.last;
  twist.last_middle = twist.middle(task.last, last_twist_.value_or(task.twist));
  twist.predicted = task.external ? task.twist : last_twist_.value_or(task.twist);
  twist.dt = task.dt <= config_.max_gap_s ? task.dt : 0.0;
  const double share = sweeps_ == 1 ? 1.0 : config_.surfel.deskew_share;  // at first, all that is known of the motion
  if (task.sampled.moving()) {
    twist.sampled = &task.sampled;
    twist.prediction = task.prediction;
    twist.translation_share = position_known(task) ? 0.0 : share;
    if (redo_first_ && first_.sweep.sampled != nullptr && !position_known(task)) {
      twist.last_middle = first_.sweep.middle(first_.pose, first_.sweep.predicted);
      twist.expected_way =
          twist.middle(task.prediction, twist.predicted).translation() - twist.last_middle.translation();
    }
    return twist;
  }
  twist.translation_share = task.external ? 0.0 : share;
  twist.rotation_share = task.external_twist ? 0.0 : share;
  return twist;
}

// From outside, and better than an unknown velocity would leave it.
bool SurfelOdometry::position_known(const SweepTask& task) const {
  constexpr double known_translation = 0.3;  // m
  return task.external &&
         (task.information.diagonal().head<3>().array() > 1.0 / (known_translation * known_translation)).all();
}

void SurfelOdometry::note_twist(const Vector6d& twist, bool sampled, double dt) {
  if (twist_changes_ == 0) {  // not seen yet: what the vehicle is capable of
    twist_change2_ << Eigen::Vector3d::Constant(std::pow(config_.surfel.max_acceleration * dt, 2)),
        Eigen::Vector3d::Constant(std::pow(config_.surfel.max_angular_acceleration * dt, 2));
  }
  if (last_twist_ && !sampled) {
    twist_changes_ = std::min(twist_changes_ + 1, lasting_changes);
    twist_change2_ += ((twist - *last_twist_).cwiseAbs2() - twist_change2_) / twist_changes_;
  }
  last_twist_ = twist;
}

// The noise of a match is that of one pose; a motion has two ends, so its covariance is twice. What the motion within
// the sweep is wrong by displaces the pose, too: of a sweep compensated with one twist, that twist's usual change from
// sweep to sweep tells the variance; of poses from outside, they do. With the covariance F of that displacement and the
// information I of the match: (2 I^-1 + 2 F)^-1 = (1 - I (I + F^-1)^-1) I / 2, also of directions that the match does
// not know. Returns the factor before I. All in the sensor frame.
Matrix6d SurfelOdometry::widened(const Matrix6d& match, const Matrix6d& lag, const SweepTask& task) const {
  constexpr double least_translation = 1e-4, least_rotation = 1e-5;  // m, rad: of coordinates in single precision
  Matrix6d twist = Matrix6d::Zero();
  if (task.sampled.moving()) {
    twist = task.sampled_covariance;
  } else if (task.times) {
    twist = twist_change2_.asDiagonal();
  }
  Matrix6d displacement = lag * twist * lag.transpose();
  displacement.diagonal().head<3>().array() += least_translation * least_translation;
  displacement.diagonal().tail<3>().array() += least_rotation * least_rotation;
  const Matrix6d sum = match + displacement.ldlt().solve(Matrix6d::Identity());
  return 0.5 * (Matrix6d::Identity() - sum.ldlt().solve(match).transpose());
}

// The second sweep without any knowledge of the velocity: if the match at rest does not convince, others along the
// heading may. The effective information about the weakest translation tells the right one.
SurfelRegistrationResult SurfelOdometry::search_start(const SweepTask& task, const SurfelPrior& prior,
                                                      const SweepTwist& twist, std::size_t needed,
                                                      const SurfelRegistrationResult& at_rest) {
  const auto strength = [&](const SurfelRegistrationResult& result) {
    return result.matched < needed ? -1e9 : result.directions.information.head<3>().minCoeff();
  };
  const double required = 1.0 / (config_.surfel.required_translation * config_.surfel.required_translation);
  if (strength(at_rest) > required && at_rest.matched > surfels_.size() * 4 / 5) return at_rest;
  SurfelPrior loose = prior;
  loose.decides_weak_directions = false;
  loose.information = start_information();
  SurfelRegistrationResult best = at_rest;
  for (int i = -start_shifts; i <= start_shifts; ++i) {
    Pose guess = task.prediction;
    guess.translation() += start_shift_step * i * guess.linear().col(0);
    const SurfelRegistrationResult shifted =
        registration_.align(surfels_, map_, guess, loose, twist, wide_gate, needed, pool_);
    if (strength(shifted) > required && strength(shifted) > 1.2 * strength(best)) best = shifted;
  }
  best.twist = twist.refined(best.pose, best.twist);
  registration_.place(surfels_, best.pose, twist, best.twist);
  return best;
}

void SurfelOdometry::keep_first(const SweepTwist& twist, const Pose& pose, const SweepMotion& sampled) {
  first_.surfels.swap(surfels_);
  first_.motion = sampled;
  first_.sweep = twist;
  if (twist.sampled != nullptr) first_.sweep.sampled = &first_.motion;
  first_.pose = pose;
  redo_first_ = true;
}

// The first sweep was undistorted without a velocity. Had the vehicle one, that sweep lies half its length behind where
// its pose says, and the motion to the second sweep is by half a sweep's too long. So with the velocity found, the map
// is made anew of the first sweep and the second one registered again, until the velocity stays.
SurfelRegistrationResult SurfelOdometry::redo_start(SweepTwist twist, std::size_t needed,
                                                    SurfelRegistrationResult result) {
  if (!first_.sweep.times || !(twist.dt > 0.0)) return result;
  const double half = 0.5 * (first_.sweep.times->last - first_.sweep.times->first);
  Vector6d used = first_.sweep.predicted;
  SurfelPrior prior;
  prior.information = start_information();
  for (int round = 0; round < start_rounds && result.matched >= needed; ++round) {
    const Vector6d change = half * (result.twist - used);
    if (change.head<3>().norm() + mean_range * change.tail<3>().norm() < settled_way) break;
    used = result.twist;
    Vector6d first_used = used;
    if (twist.sampled != nullptr) {  // the velocity found, besides what was known of the motion
      const Eigen::Vector3d velocity = result.pose.linear() * (used - twist.predicted).head<3>();
      first_used = first_.sweep.predicted;
      first_used.head<3>() += first_.pose.linear().transpose() * velocity;
    }
    map_.clear();
    map_.add(registration_.place(first_.surfels, first_.pose, first_.sweep, first_used), first_.pose.translation());
    twist.last_middle = first_.sweep.middle(first_.pose, first_used);
    twist.rotation_from_middles = true;
    if (twist.sampled == nullptr) twist.predicted = used;
    prior.pose = result.pose;
    const SurfelRegistrationResult before = result;
    result = registration_.align(surfels_, map_, prior.pose, prior, twist, wide_gate, needed, pool_);
    result.associations += before.associations;
    result.solves += before.solves;
  }
  return result;
}

void SurfelOdometry::process(const SweepTask& task, Estimate& estimate) {
  estimate.pose = task.prediction;
  const Cloud image = image_.organise(task.cloud);
  extractor_.extract(image, pool_, surfels_, estimate.scan);
  estimate.scan.registered = static_cast<std::uint32_t>(surfels_.size());
  if (surfels_.size() < config_.min_points) {
    estimate.status = Status::too_few_points;
    last_twist_.reset();
    redo_first_ = false;
    return;
  }
  // After a pause without a prior nobody knows where in the map the sensor is, and one stretch of a tunnel looks like
  // another.
  if (task.dt > config_.max_gap_s && !task.external) reset();
  const SweepTwist twist = twist_of(task);
  if (map_.empty()) {
    estimate.status = Status::initialising;
    registration_.place(surfels_, estimate.pose, twist, twist.predicted);
  } else {
    const bool wide = sweeps_ < wide_gate_sweeps;
    const std::size_t needed = std::max<std::size_t>(30, surfels_.size() / 10);
    const SurfelPrior prior = prior_of(task);
    const bool only_guess = task.external && task.information.isZero(0.0);
    const double residual_gate = wide || only_guess ? wide_gate : std::max(gate, 12.0 * last_median_);
    SurfelRegistrationResult result;
    if (only_guess) {
      SurfelPrior loose = prior;
      loose.decides_weak_directions = false;
      result = registration_.align(surfels_, map_, task.prediction, loose, twist, residual_gate, needed, pool_);
    }
    // From outside without a width: the match alone, unless it then turns out weak.
    if (!only_guess || result.matched < needed || !translation_observable(result.directions)) {
      result = registration_.align(surfels_, map_, prior.pose, prior, twist, residual_gate, needed, pool_);
    }
    const bool velocity_open = !task.external || (task.sampled.moving() && !position_known(task));
    if (sweeps_ == 1 && velocity_open) result = search_start(task, prior, twist, needed, result);
    if (redo_first_ && velocity_open) result = redo_start(twist, needed, result);
    redo_first_ = false;
    estimate.scan.matched = static_cast<std::uint32_t>(result.matched);
    estimate.scan.associations = static_cast<std::uint32_t>(result.associations);
    estimate.scan.solves = static_cast<std::uint32_t>(result.solves);
    estimate.scan.rms_residual = result.rms_residual;
    estimate.scan.planar_ratio = 1.0;
    if (result.matched < needed) {
      estimate.status = Status::lost;
      last_twist_.reset();
      return;
    }
    note_twist(result.twist, task.sampled.moving(), task.dt);
    last_median_ = result.median_residual;
    estimate.pose = result.pose;
    Matrix6d turn = Matrix6d::Zero();
    turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = result.pose.linear();
    const Matrix6d match = turn.transpose() * DirectionalInformation::exported(result.directions) * turn;
    const Vector6d slope =
        turn.transpose() * DirectionalInformation::exported_gradient(result.directions, result.gradient);
    const Matrix6d share = widened(match, turn.transpose() * result.lag * turn, task);
    estimate.information = share * match;
    estimate.information = 0.5 * (estimate.information + estimate.information.transpose().eval());
    estimate.gradient = share * slope;
    estimate.localizability = localizability(result.directions, result.pose.linear());
    estimate.status = estimate.localizability.unobservable() > 0 ? Status::degenerate : Status::ok;
  }
  map_.add(registration_.placed(), estimate.pose.translation());
  if (sweeps_ == 0) keep_first(twist, estimate.pose, task.sampled);
  ++sweeps_;
  estimate.scan.map_cells = static_cast<std::uint32_t>(map_.cells());
  estimate.scan.evicted_cells = static_cast<std::uint32_t>(map_.evicted());
}

}  // namespace adit::lidar_odometry
