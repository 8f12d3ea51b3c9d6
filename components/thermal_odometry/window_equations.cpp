#include <cmath>

#include "components/thermal_odometry/patch_block.hpp"
#include "components/thermal_odometry/window.hpp"

namespace adit::thermal_odometry {
namespace {

using Block = Eigen::Matrix<double, state_size, state_size>;
using Relative8 = Eigen::Matrix<float, state_size, 1>;

// Geometry of a host and a target: the warp at the current state for values, the one at first estimates for Jacobians,
// and how a relative increment follows from the two absolute ones.
struct Pair {
  Warp current;
  Warp first;
  Block to_host;  // relative = to_host host + target
  Block H = Block::Zero();
  Eigen::Matrix<double, state_size, 1> g = Eigen::Matrix<double, state_size, 1>::Zero();
  bool touched = false;

  void set(const Keyframe& host, const Keyframe& target, const Pinhole& camera) {
    current = Warp(host.state, target.state, camera);
    first = Warp(host.first, target.first, camera);
    to_host.setZero();
    to_host.topLeftCorner<6, 6>() = -se3_adjoint(target.first.T_cw * host.first.T_cw.inverse());
    to_host(6, 6) = -1.0;
    to_host(7, 7) = -static_cast<double>(current.gain);
    H.setZero();
    g.setZero();
    touched = false;
  }
};

}  // namespace

const Window::Normal& Window::linearise(bool only_marked, double depth_damping) {
  std::array<std::array<Pair, max_keyframes>, max_keyframes> pairs;
  for (int h = 0; h < max_keyframes; ++h) {
    for (int t = 0; t < max_keyframes; ++t) {
      if (h != t && keyframe(h).used && keyframe(t).used) {
        pairs[static_cast<std::size_t>(h)][static_cast<std::size_t>(t)].set(keyframe(h), keyframe(t), camera_);
      }
    }
  }
  normal_.H.setZero();
  normal_.g.setZero();
  normal_.energy = 0.0;
  normal_.scale = 0.0;
  normal_.residuals = 0;
  systems_.resize(points_.size());
  const float inverse_sigma2 = 1.0F / (sigma_ * sigma_);
  const float nu = config_.nu;
  PatchView view;
  std::array<int, max_keyframes> seen{};

  for (std::size_t i = 0; i < points_.size(); ++i) {
    WindowPoint& point = points_[i];
    PointSystem& system = systems_[i];
    if (only_marked && !system.marked) continue;
    const Patch& patch = point.patch;
    auto& coupling = couplings_[i];
    coupling.setZero();
    system.H = 0.0F;
    system.g = 0.0F;
    point.good = 0;
    int targets = 0;
    const auto host = static_cast<std::size_t>(patch.host);
    // What enters the prior counts less where neighbouring residuals say the same again and nothing contradicts them.
    const float share = !only_marked       ? 1.0F
                        : point.anchored() ? config_.anchored_marginal_weight
                                           : config_.marginal_weight;
    for (int t = 0; t < max_keyframes; ++t) {
      if (t == patch.host || !keyframe(t).used) continue;
      Sight& sight = point.sight[static_cast<std::size_t>(t)];
      Pair& pair = pairs[host][static_cast<std::size_t>(t)];
      const bool visible = view_patch(keyframe(t).image.level(0), pair.current, patch.u, patch.v, patch.inverse_depth,
                                      patch.slope_u, patch.slope_v, view);
      if (!visible) {
        sight = Sight::outside;
        continue;
      }
      const Pattern r = view.value - (pair.current.gain * point.look.intensity + pair.current.offset);
      const Pattern normalised = r.square() * inverse_sigma2;
      const float patch_energy = (point.look.weight * normalised).mean();
      if (patch_energy > config_.outlier) {
        sight = Sight::outlier;
        normal_.energy += config_.outlier;
        continue;
      }
      sight = Sight::in;
      ++point.good;
      ++normal_.residuals;
      const Pattern robust = point.look.weight * (nu + 1.0F) / (nu + normalised);
      const Pattern w = share * inverse_sigma2 * robust;
      normal_.scale += static_cast<double>((robust * r.square()).mean());
      normal_.energy += static_cast<double>((robust * normalised).mean());

      // Geometry at the first estimates, once a patch; image gradients at the current state.
      const Eigen::Vector3f X = pair.first.ray(patch.u, patch.v, patch.inverse_depth);
      if (!(X.z() > 0.05F)) continue;
      view.rho = 1.0F / X.z();
      view.x = X.x() * view.rho;
      view.y = X.y() * view.rho;
      const Eigen::Matrix<float, 2, 6> J =
          pixel_jacobian(pair.first.fx, pair.first.fy, view.x, view.y, patch.inverse_depth * view.rho);
      const Eigen::Vector2f Jd = view.by_depth(pair.first);
      const auto host_b = static_cast<float>(keyframe(patch.host).state.b);
      const Pattern by_gain = -pair.current.gain * (point.look.intensity - host_b);
      const PatchBlock block = patch_block(view, J, Jd, w, r, by_gain);
      pair.H += block.H.cast<double>();
      pair.g += block.g.cast<double>();
      pair.touched = true;
      system.H += block.depth_H;
      system.g += block.depth_g;
      const Relative8& c = block.coupling;
      coupling.segment<state_size>(t * state_size) = c;
      coupling.segment<state_size>(patch.host * state_size).noalias() += pair.to_host.cast<float>().transpose() * c;
      seen[static_cast<std::size_t>(targets++)] = t;
    }
    point.hessian = system.H;
    const float information = share * point.prior_information;
    const float disagreement =
        patch.inverse_depth - point.prior_depth - point.by_boresight.dot(boresight_.cast<float>());
    system.H += information;
    system.g += information * disagreement;
    system.H *= static_cast<float>(1.0 + depth_damping);
    if (targets == 0 || !(system.H > 1e-6F)) {
      system.H = 0.0F;
      continue;
    }
    seen[static_cast<std::size_t>(targets++)] = patch.host;
    if (point.anchored()) {
      const Eigen::Vector3f by = -information * point.by_boresight;
      coupling.tail<boresight_size>() = by;
      normal_.H.bottomRightCorner<boresight_size, boresight_size>() -=
          (by * point.by_boresight.transpose()).cast<double>();
      normal_.g.tail<boresight_size>() += (disagreement * by).cast<double>();
    }
    // Eliminating the depth: a rank-one update on the blocks of the keyframes that see the point.
    const double inverse = 1.0 / static_cast<double>(system.H);
    const Eigen::Vector3d turning = coupling.tail<boresight_size>().cast<double>();
    normal_.H.bottomRightCorner<boresight_size, boresight_size>() -= inverse * turning * turning.transpose();
    normal_.g.tail<boresight_size>() -= inverse * static_cast<double>(system.g) * turning;
    for (int a = 0; a < targets; ++a) {
      const int ra = seen[static_cast<std::size_t>(a)] * state_size;
      const Eigen::Matrix<double, state_size, 1> ca = coupling.segment<state_size>(ra).cast<double>() * inverse;
      normal_.g.segment<state_size>(ra) -= ca * static_cast<double>(system.g);
      for (int b = 0; b < targets; ++b) {
        const int rb = seen[static_cast<std::size_t>(b)] * state_size;
        if (rb > ra) continue;
        normal_.H.block<state_size, state_size>(ra, rb).noalias() -=
            ca.lazyProduct(coupling.segment<state_size>(rb).cast<double>().transpose());
      }
      normal_.H.block<boresight_size, state_size>(boresight_at, ra).noalias() -= turning.lazyProduct(ca.transpose());
    }
  }
  // Lower triangle so far; the pairs' blocks are stitched into it with their adjoints.
  for (int h = 0; h < max_keyframes; ++h) {
    for (int t = 0; t < max_keyframes; ++t) {
      if (h == t || !keyframe(h).used || !keyframe(t).used) continue;
      const Pair& pair = pairs[static_cast<std::size_t>(h)][static_cast<std::size_t>(t)];
      if (!pair.touched) continue;
      const int rh = h * state_size;
      const int rt = t * state_size;
      const Block cross = pair.to_host.transpose().lazyProduct(pair.H);
      normal_.H.block<state_size, state_size>(rh, rh) += cross.lazyProduct(pair.to_host);
      normal_.H.block<state_size, state_size>(rt, rt) += pair.H;
      if (rh > rt) {
        normal_.H.block<state_size, state_size>(rh, rt) += cross;
      } else {
        normal_.H.block<state_size, state_size>(rt, rh) += cross.transpose();
      }
      normal_.g.segment<state_size>(rh) += pair.to_host.transpose() * pair.g;
      normal_.g.segment<state_size>(rt) += pair.g;
    }
  }
  for (int r = 0; r < dimension; ++r) {
    for (int c = r + 1; c < dimension; ++c) normal_.H(r, c) = normal_.H(c, r);
  }
  if (normal_.residuals > 0) normal_.scale /= normal_.residuals;
  return normal_;
}

}  // namespace adit::thermal_odometry
