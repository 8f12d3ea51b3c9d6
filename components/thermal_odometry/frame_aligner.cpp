#include "components/thermal_odometry/frame_aligner.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Cholesky>

namespace adit::thermal_odometry {
namespace {

constexpr int usual_top = 3;  // coarsest level without a gap
// How wrong the foreseen spin is: running mean over about so many frames, at least, at most, and after a gap [rad/s].
constexpr double spin_memory = 10.0;
constexpr double min_spin_sigma = 0.005;
constexpr double max_spin_sigma = 1.0;
constexpr double unknown_spin_sigma = 0.1;

std::optional<Tracker::PosePrior> pose_prior(const Prior* prior, const Pose& T_cw) {
  if (prior == nullptr || !prior->T_previous_current.matrix().allFinite() || !prior->covariance.allFinite())
    return std::nullopt;
  Tracker::PosePrior out;
  out.T_cw = prior->T_previous_current.inverse() * T_cw;
  // Covariance of the left increment of T_previous_current, carried to the left increment of T_cw.
  const Matrix6d adjoint = se3_adjoint(prior->T_previous_current.inverse());
  const Matrix6d covariance = adjoint * prior->covariance * adjoint.transpose() + 1e-12 * Matrix6d::Identity();
  out.information = covariance.ldlt().solve(Matrix6d::Identity());
  return out;
}

}  // namespace

FrameAligner::Alignment FrameAligner::align(const Tracker& tracker, const Pyramid& image, std::int64_t stamp_ns,
                                            double reference_gain, const Prior* prior) const {
  Alignment out;
  out.dt = 1e-9 * static_cast<double>(stamp_ns - stamp_ns_);
  out.gap = out.dt > config_.gap_s;
  out.predicted = has_velocity_ ? se3_exp(velocity_ * out.dt) * state_.T_cw : state_.T_cw;

  std::array<Pose, 3> starts{out.predicted, state_.T_cw, state_.T_cw};
  std::size_t count = has_velocity_ && out.gap ? 2 : 1;
  const std::optional<Tracker::PosePrior> said = pose_prior(prior, state_.T_cw);
  if (said) starts[count++] = said->T_cw;

  const int top = out.gap ? Pyramid::max_levels - 1 : usual_top;
  CameraState start = state_;
  start.T_cw = out.predicted;
  if (out.gap) start.a = reference_gain;
  Tracker::Before before{state_.T_cw, out.dt, Vector6d::Zero(), unknown_spin_sigma};
  if (has_velocity_ && !out.gap) {
    before.rate_change = velocity_change_;
    before.spin_sigma = std::clamp(std::sqrt(spin_variance_), min_spin_sigma, max_spin_sigma);
  }
  double best_cost = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count && count > 1; ++i) {
    CameraState candidate = start;
    candidate.T_cw = starts[i];
    const double cost = tracker.cost(image, candidate, std::min(top, image.levels() - 1));
    if (cost < best_cost) {
      best_cost = cost;
      start.T_cw = candidate.T_cw;
    }
  }
  const Tracker::PosePrior* information = said && config_.prior_as_information ? &*said : nullptr;
  out.result = tracker.track(image, start, top, information, &before);
  if (!out.result.ok) out.result = search(tracker, image, start, information, before);
  const Pose& expected = said ? said->T_cw : out.predicted;
  const bool foreseen = said || has_velocity_;
  if (out.gap && foreseen && out.result.ok && !within_reach(out.result, expected, out.dt)) {
    start.T_cw = expected;
    out.result = tracker.track(image, start, usual_top, information, &before);
    out.result.ok = out.result.ok && within_reach(out.result, expected, out.dt);
  }
  return out;
}

bool FrameAligner::within_reach(const TrackResult& result, const Pose& expected, double dt) const {
  const Eigen::Vector3d off = result.state.T_cw.inverse().translation() - expected.inverse().translation();
  return off.norm() <= 0.5 * config_.max_acceleration * dt * dt;
}

// Small rotations about the start, from the coarsest level: only after a failure.
TrackResult FrameAligner::search(const Tracker& tracker, const Pyramid& image, const CameraState& start,
                                 const Tracker::PosePrior* prior, const Tracker::Before& before) const {
  TrackResult best;
  const int top = image.levels() - 1;
  double best_cost = std::numeric_limits<double>::infinity();
  CameraState best_start = start;
  for (int i = 0; i < 27; ++i) {
    const Eigen::Vector3d axis(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
    for (double angle : {0.03, 0.07}) {
      CameraState candidate = start;
      candidate.T_cw = Pose(so3_exp(angle * axis)) * start.T_cw;
      const double cost = tracker.cost(image, candidate, top);
      if (cost < best_cost) {
        best_cost = cost;
        best_start = candidate;
      }
    }
  }
  if (std::isfinite(best_cost)) best = tracker.track(image, best_start, top, prior, &before);
  if (best.ok) return best;
  CameraState still = start;
  still.T_cw = state_.T_cw;
  return tracker.track(image, still, top, prior, &before);
}

void FrameAligner::move_to(std::int64_t stamp_ns, const CameraState& state) {
  const double dt = 1e-9 * static_cast<double>(stamp_ns - stamp_ns_);
  const Vector6d velocity = se3_log(state.T_cw * state_.T_cw.inverse()) / dt;
  const Vector6d foreseen = velocity_change_;
  velocity_change_.setZero();
  if (has_velocity_ && dt < config_.gap_s) {
    velocity_change_ = 0.5 * (velocity - velocity_);
    // At the last frame the rate was between those of the intervals beside it.
    const double missed = (velocity_change_ - foreseen).tail<3>().squaredNorm() / 3.0;
    spin_variance_ += (missed - spin_variance_) / spin_memory;
  }
  set_velocity(velocity);
  correct(state);
  stamp_ns_ = stamp_ns;
}

void FrameAligner::correct(const CameraState& state) {
  state_.T_cw = state.T_cw;
  state_.a = state.a;
  state_.b = state.b;
}

void FrameAligner::place(std::int64_t stamp_ns, const Pose& T_cw) {
  state_.T_cw = T_cw;
  stamp_ns_ = stamp_ns;
  has_velocity_ = false;
}

void FrameAligner::set_velocity(const Vector6d& velocity) {
  velocity_ = velocity;
  has_velocity_ = true;
}

}  // namespace adit::thermal_odometry
