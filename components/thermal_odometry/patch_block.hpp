// Normal equations of one patch seen in one target, for everything that estimates poses and depths together.
#pragma once

#include <Eigen/Core>

#include "components/thermal_odometry/warp.hpp"

namespace adit::thermal_odometry {

// About the target's increment [translation, rotation, a, b] and the inverse depth in the host.
struct PatchBlock {
  Eigen::Matrix<float, 8, 8> H;
  Eigen::Matrix<float, 8, 1> g;
  Eigen::Matrix<float, 8, 1> coupling;  // of the increment with the depth
  float depth_H;
  float depth_g;
};

// `J` and `by_depth`: d(pixel of the patch's centre) by the pose and by the depth; the image's gradients are those of
// every pattern pixel in `view` (Engel et al., DSO, 2018, section 2.3: 2 x 2 sums instead of eight rank-one updates).
// `weight` includes 1/sigma^2; `by_gain`: d(residual)/da; d(residual)/db is -1.
inline PatchBlock patch_block(const PatchView& view, const Eigen::Matrix<float, 2, 6>& J,
                              const Eigen::Vector2f& by_depth, const Pattern& weight, const Pattern& residual,
                              const Pattern& by_gain) {
  const Pattern wgx = weight * view.gx;
  const Pattern wgy = weight * view.gy;
  Eigen::Matrix2f G;
  G(0, 0) = (wgx * view.gx).sum();
  G(0, 1) = G(1, 0) = (wgx * view.gy).sum();
  G(1, 1) = (wgy * view.gy).sum();
  const Eigen::Vector2f gr((wgx * residual).sum(), (wgy * residual).sum());
  Eigen::Matrix2f affine;  // columns: with a, with b
  affine << (wgx * by_gain).sum(), -wgx.sum(), (wgy * by_gain).sum(), -wgy.sum();
  PatchBlock block;
  block.H.topLeftCorner<6, 6>().noalias() = J.transpose() * (G * J);
  block.H.topRightCorner<6, 2>().noalias() = J.transpose() * affine;
  block.H.bottomLeftCorner<2, 6>() = block.H.topRightCorner<6, 2>().transpose();
  block.H(6, 6) = (weight * by_gain.square()).sum();
  block.H(6, 7) = block.H(7, 6) = -(weight * by_gain).sum();
  block.H(7, 7) = weight.sum();
  block.g.head<6>().noalias() = J.transpose() * gr;
  block.g[6] = (weight * by_gain * residual).sum();
  block.g[7] = -(weight * residual).sum();
  const Eigen::Vector2f Gd = G * by_depth;
  block.coupling.head<6>().noalias() = J.transpose() * Gd;
  block.coupling.tail<2>().noalias() = affine.transpose() * by_depth;
  block.depth_H = by_depth.dot(Gd);
  block.depth_g = by_depth.dot(gr);
  return block;
}

}  // namespace adit::thermal_odometry
