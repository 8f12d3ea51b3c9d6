#include "components/thermal_odometry/tracker.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

namespace adit::thermal_odometry {
namespace {

constexpr int max_views = 8;
constexpr double no_spin = 1e-6;  // rad/s: holds the spin where nothing may be said of it
using Matrix6f = Eigen::Matrix<float, 6, 6>;
}  // namespace

Tracker::Tracker(const Pinhole& camera, int levels, std::size_t capacity, const Config& config)
    : camera_(camera), levels_(levels), config_(config) {
  views_.reserve(max_views);
  patches_.reserve(capacity);
  for (auto& level : templates_) level.reserve(capacity);
  scratch_.reserve(capacity);
}

void Tracker::set_reference(std::span<const ReferenceView> views, std::span<const Patch> patches, int newest) {
  views_.assign(views.begin(), views.end());
  newest_ = newest;
  patches_.assign(patches.begin(),
                  patches.begin() + static_cast<std::ptrdiff_t>(std::min(patches.size(), patches_.capacity())));
  for (int l = 0; l < levels_; ++l) {
    auto& templates = templates_[static_cast<std::size_t>(l)];
    templates.resize(patches_.size());
    int& count = template_counts_[static_cast<std::size_t>(l)];
    count = 0;
    for (std::size_t i = 0; i < patches_.size(); ++i) {
      const Patch& patch = patches_[i];
      templates[i].weight.setZero();
      const Pyramid* pyramid = views_[static_cast<std::size_t>(patch.host)].image;
      if (pyramid == nullptr) continue;
      const bool fits = take_template(pyramid->level(l), at_level(patch.u, l), at_level(patch.v, l),
                                      config_.gradient_scale, templates[i]);
      if (fits) ++count;
    }
  }
}

Tracker::System Tracker::linearise(const Pyramid& pyramid, const CameraState& state, int level, float sigma,
                                   bool with_jacobian) const {
  System system;
  const Image& image = pyramid.level(level);
  const Pinhole camera = camera_.at_level(level);
  std::array<Warp, max_views> relatives;
  for (std::size_t h = 0; h < views_.size(); ++h) relatives[h] = Warp(views_[h].state, state, camera);
  const auto& templates = templates_[static_cast<std::size_t>(level)];
  const float slope_scale = static_cast<float>(1 << level);
  const float inverse_sigma2 = 1.0F / (sigma * sigma);
  const float nu = config_.nu;
  PatchView view;

  Eigen::Matrix<float, states, states> block = Eigen::Matrix<float, states, states>::Zero();
  Eigen::Matrix<float, states, 1> block_g = Eigen::Matrix<float, states, 1>::Zero();
  float block_cost = 0.0F;
  float block_scale = 0.0F;
  int in_block = 0;
  const auto flush = [&] {
    system.H += block.cast<double>();
    system.g += block_g.cast<double>();
    system.cost += block_cost;
    system.scale += block_scale;
    block.setZero();
    block_g.setZero();
    block_cost = block_scale = 0.0F;
    in_block = 0;
  };

  for (std::size_t i = 0; i < patches_.size(); ++i) {
    const PatchTemplate& entry = templates[i];
    if (entry.weight[0] == 0.0F) continue;
    const Patch& patch = patches_[i];
    const Warp& warp = relatives[static_cast<std::size_t>(patch.host)];
    const bool visible =
        view_patch(image, warp, at_level(patch.u, level), at_level(patch.v, level), patch.inverse_depth,
                   patch.slope_u * slope_scale, patch.slope_v * slope_scale, view);
    if (!visible) continue;
    const Pattern r = view.value - (warp.gain * entry.intensity + warp.offset);
    const Pattern& gx = view.gx;
    const Pattern& gy = view.gy;
    // An uncertain depth weighs as much as the residual it may cause.
    const Eigen::Vector2f by_depth = view.by_depth(warp);
    const float j2 = (gx * by_depth.x() + gy * by_depth.y()).square().mean();
    const float trust = 1.0F / (1.0F + j2 * patch.sigma * patch.sigma * inverse_sigma2);
    const Pattern normalised = r.square() * inverse_sigma2;
    const Pattern robust = entry.weight * (nu + 1.0F) / (nu + trust * normalised);
    ++system.points;
    system.pixels += pattern_size;
    system.inliers += static_cast<int>((trust * normalised < 9.0F).count());
    block_scale += (trust * robust * r.square()).sum();
    block_cost += (robust * trust * normalised).sum();
    if (!with_jacobian) {
      if (++in_block == 64) flush();
      continue;
    }
    const Pattern w = robust * trust * inverse_sigma2;
    const Pattern ja = -(warp.gain * entry.intensity + (warp.offset - static_cast<float>(state.b)));
    const Pattern wgx = w * gx;
    const Pattern wgy = w * gy;
    Eigen::Matrix2f G;
    G(0, 0) = (wgx * gx).sum();
    G(0, 1) = G(1, 0) = (wgx * gy).sum();
    G(1, 1) = (wgy * gy).sum();
    const Eigen::Vector2f gr((wgx * r).sum(), (wgy * r).sum());
    Eigen::Matrix2f affine;  // columns: with a, with b
    affine << (wgx * ja).sum(), -wgx.sum(), (wgy * ja).sum(), -wgy.sum();
    const Eigen::Matrix<float, 2, 6> J =
        pixel_jacobian(warp.fx, warp.fy, view.x, view.y, patch.inverse_depth * view.rho);
    const Matrix6f by_pose = J.transpose() * (G * J);
    const Eigen::Matrix<float, 6, 2> by_affine = J.transpose() * affine;
    const Eigen::Matrix<float, 6, 1> gradient = J.transpose() * gr;
    block.topLeftCorner<6, 6>() += by_pose;
    block.block<6, 2>(0, 6) += by_affine;
    block_g.head<6>() += gradient;
    block(6, 6) += (w * ja.square()).sum();
    block(6, 7) -= (w * ja).sum();
    block(7, 7) += w.sum();
    block_g[6] += (w * ja * r).sum();
    block_g[7] -= (w * r).sum();
    if (warp.rolling) {
      const float later = warp.row_time * (warp.fy * view.y + warp.cy - warp.middle_row);
      block.block<6, 3>(0, 8) += later * by_pose.rightCols<3>();
      block.block<2, 3>(6, 8) += later * by_affine.bottomRows<3>().transpose();
      block.bottomRightCorner<3, 3>() += later * later * by_pose.bottomRightCorner<3, 3>();
      block_g.tail<3>() += later * gradient.tail<3>();
    }
    if (++in_block == 64) flush();
  }
  flush();
  system.H = system.H.selfadjointView<Eigen::Upper>().toDenseMatrix();
  if (system.pixels > 0) {
    system.scale /= system.pixels;
    system.cost /= system.pixels;
  }
  return system;
}

double Tracker::cost(const Pyramid& image, const CameraState& state, int level) const {
  CameraState shifted = state;
  shifted.b += median_offset(image, state, level);
  const System system = linearise(image, shifted, level, 0.5F * config_.max_sigma, false);
  if (system.points < config_.min_points / 2) return std::numeric_limits<double>::infinity();
  const double share =
      static_cast<double>(system.points) / std::max(1, template_counts_[static_cast<std::size_t>(level)]);
  return system.cost / std::min(1.0, share + 0.3);
}

double Tracker::median_offset(const Pyramid& pyramid, const CameraState& state, int level) const {
  const Image& image = pyramid.level(level);
  const Pinhole camera = camera_.at_level(level);
  scratch_.clear();
  std::array<Warp, max_views> relatives;
  for (std::size_t h = 0; h < views_.size(); ++h) relatives[h] = Warp(views_[h].state, state, camera);
  const auto& templates = templates_[static_cast<std::size_t>(level)];
  for (std::size_t i = 0; i < patches_.size(); ++i) {
    if (templates[i].weight[0] == 0.0F) continue;
    const Patch& patch = patches_[i];
    const Warp& relative = relatives[static_cast<std::size_t>(patch.host)];
    const Eigen::Vector3f X = relative.ray(at_level(patch.u, level), at_level(patch.v, level), patch.inverse_depth);
    if (!(X.z() > 0.05F)) continue;
    const float px = static_cast<float>(camera.fx) * X.x() / X.z() + static_cast<float>(camera.cx);
    const float py = static_cast<float>(camera.fy) * X.y() / X.z() + static_cast<float>(camera.cy);
    if (!samplable(image, px, py)) continue;
    scratch_.push_back(sample_value(image, px, py) - (relative.gain * templates[i].intensity.mean() + relative.offset));
  }
  if (scratch_.empty()) return 0.0;
  const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 2);
  std::nth_element(scratch_.begin(), middle, scratch_.end());
  return *middle;
}

float Tracker::median_flow(const CameraState& state) const {
  scratch_.clear();
  std::array<Warp, max_views> to_newest;
  std::array<Warp, max_views> to_current;
  const CameraState& newest = views_[static_cast<std::size_t>(newest_)].state;
  for (std::size_t h = 0; h < views_.size(); ++h) {
    to_newest[h] = Warp(views_[h].state, newest, camera_);
    to_current[h] = Warp(views_[h].state, state, camera_);
  }
  const auto fx = static_cast<float>(camera_.fx);
  const auto fy = static_cast<float>(camera_.fy);
  for (const Patch& patch : patches_) {
    const auto project = [&](const Warp& relative) { return relative.ray(patch.u, patch.v, patch.inverse_depth); };
    const Eigen::Vector3f before = project(to_newest[static_cast<std::size_t>(patch.host)]);
    const Eigen::Vector3f after = project(to_current[static_cast<std::size_t>(patch.host)]);
    if (!(before.z() > 0.05F && after.z() > 0.05F)) continue;
    scratch_.push_back(std::hypot(fx * (after.x() / after.z() - before.x() / before.z()),
                                  fy * (after.y() / after.z() - before.y() / before.z())));
  }
  if (scratch_.empty()) return 0.0F;
  const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 2);
  std::nth_element(scratch_.begin(), middle, scratch_.end());
  return *middle;
}

float Tracker::correlation(const Pyramid& pyramid, const CameraState& state, int level) const {
  const Image& image = pyramid.level(level);
  const Pinhole camera = camera_.at_level(level);
  std::array<Warp, max_views> relatives;
  for (std::size_t h = 0; h < views_.size(); ++h) relatives[h] = Warp(views_[h].state, state, camera);
  const auto& templates = templates_[static_cast<std::size_t>(level)];
  double n = 0.0;
  double sum_a = 0.0;
  double sum_b = 0.0;
  double sum_aa = 0.0;
  double sum_ab = 0.0;
  double sum_bb = 0.0;
  for (std::size_t i = 0; i < patches_.size(); ++i) {
    if (templates[i].weight[0] == 0.0F) continue;
    const Patch& patch = patches_[i];
    const Warp& relative = relatives[static_cast<std::size_t>(patch.host)];
    const Eigen::Vector3f centre =
        relative.ray(at_level(patch.u, level), at_level(patch.v, level), patch.inverse_depth);
    for (int k = 0; k < pattern_size; ++k) {
      const Eigen::Vector3f X = centre + pattern_x[static_cast<std::size_t>(k)] * relative.step_u +
                                pattern_y[static_cast<std::size_t>(k)] * relative.step_v;
      if (!(X.z() > 0.05F)) continue;
      const float px = static_cast<float>(camera.fx) * X.x() / X.z() + static_cast<float>(camera.cx);
      const float py = static_cast<float>(camera.fy) * X.y() / X.z() + static_cast<float>(camera.cy);
      if (!samplable(image, px, py)) continue;
      const double a = static_cast<double>(relative.gain * templates[i].intensity[k] + relative.offset);
      const double b = static_cast<double>(sample_value(image, px, py));
      const double w = templates[i].weight[k] / (1.0 + 1e-4 * a * a);  // a lamp is not the scene
      n += w;
      sum_a += w * a;
      sum_b += w * b;
      sum_aa += w * a * a;
      sum_ab += w * a * b;
      sum_bb += w * b * b;
    }
  }
  const double variance = (n * sum_aa - sum_a * sum_a) * (n * sum_bb - sum_b * sum_b);
  return variance > 0.0 ? static_cast<float>((n * sum_ab - sum_a * sum_b) / std::sqrt(variance)) : 0.0F;
}

TrackResult Tracker::track(const Pyramid& image, const CameraState& start, int top_level, const PosePrior* prior,
                           const Before* before) const {
  TrackResult result;
  result.state = start;
  if (patches_.empty() || views_.empty()) return result;
  const int top = std::min(top_level, levels_ - 1);
  const double reference_a = views_[static_cast<std::size_t>(newest_)].state.a;
  CameraState state = start;
  Eigen::Vector3d spin = Eigen::Vector3d::Zero();  // rad/s, beyond what follows from `before`
  const double spin_sigma = std::max(before != nullptr ? before->spin_sigma : 0.0, no_spin);
  const double spin_information = 1.0 / (spin_sigma * spin_sigma);
  const auto add_priors = [&](System& system) {
    const double gain_information = 1.0 / (config_.gain_sigma * config_.gain_sigma);
    system.H(6, 6) += gain_information;
    system.g[6] += gain_information * (state.a - reference_a);
    system.H.diagonal().tail<3>().array() += spin_information;
    system.g.tail<3>() += spin_information * spin;
  };
  const auto update_rate = [&] {
    if (before == nullptr || camera_.row_time == 0.0) return;
    state.rate = se3_log(state.T_cw * before->T_cw.inverse()) / before->dt + before->rate_change;
    state.rate.tail<3>() += spin;
  };
  update_rate();
  state.b += median_offset(image, state, top);
  float sigma = config_.max_sigma * 0.5F;
  System system;
  for (int level = top; level >= std::min(config_.finest_level, top); --level) {
    for (int iteration = 0; iteration < config_.max_iterations; ++iteration) {
      system = linearise(image, state, level, sigma, true);
      if (system.points < config_.min_points / 2) return result;
      sigma = std::clamp(static_cast<float>(std::sqrt(system.scale)), config_.min_sigma, config_.max_sigma);
      add_priors(system);
      Matrix& H = system.H;
      Vector& g = system.g;
      if (prior != nullptr) {
        H.topLeftCorner<6, 6>() += prior->information;
        g.head<6>() += prior->information * se3_log(state.T_cw * prior->T_cw.inverse());
      }
      H.diagonal() *= 1.0001;
      const Vector step = -H.ldlt().solve(g);
      if (!step.allFinite() || step.head<6>().norm() > 10.0) return result;
      state.T_cw = se3_exp(step.head<6>()) * state.T_cw;
      state.a += step[6];
      state.b += step[7];
      spin += step.tail<3>();
      update_rate();
      if (step.head<3>().norm() < config_.stop_translation && step.segment<3>(3).norm() < config_.stop_rotation) break;
    }
  }
  const int finest = std::min(config_.finest_level, top);
  system = linearise(image, state, finest, sigma, true);
  state.T_cw.linear() = orthonormalized(state.T_cw.linear());
  result.state = state;
  result.sigma = static_cast<float>(std::sqrt(system.scale));
  result.points = system.points;
  const int templates = std::max(1, template_counts_[static_cast<std::size_t>(finest)]);
  result.visible_share = static_cast<float>(system.points) / static_cast<float>(templates);
  result.inlier_share = static_cast<float>(system.inliers) / static_cast<float>(std::max(1, system.pixels));
  result.correlation = correlation(image, state, finest);
  result.median_flow = median_flow(state);
  // Brightness and spin marginalised; the prior on the spin is part of what the rows mean.
  system.H.diagonal().tail<5>().array() += 1e-6;
  system.H.diagonal().tail<3>().array() += spin_information;
  const Eigen::Matrix<double, 6, 5> cross = system.H.topRightCorner<6, 5>();
  result.information =
      system.H.topLeftCorner<6, 6>() - cross * system.H.bottomRightCorner<5, 5>().ldlt().solve(cross.transpose());
  result.information = 0.5 * (result.information + result.information.transpose()).eval();
  result.ok = state.T_cw.matrix().allFinite() && system.points >= config_.min_points &&
              result.visible_share >= config_.min_visible_share && result.inlier_share >= config_.min_inlier_share &&
              result.correlation >= config_.min_correlation && result.sigma < 1.5F * config_.max_sigma;
  return result;
}

}  // namespace adit::thermal_odometry
