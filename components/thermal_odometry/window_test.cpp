#include "components/thermal_odometry/window.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include <Eigen/Dense>

#include "components/thermal_odometry/front_end.hpp"
#include "components/thermal_odometry/selection.hpp"
#include "components/thermal_odometry/test_scene.hpp"

namespace adit::thermal_odometry {
namespace {

// Keyframes along the corridor with exact or disturbed poses and depths.
struct Toy {
  TestScene scene;
  FrontEnd front_end{scene.camera, {.noise_counts = 2.5F}};
  Pinhole pinhole{scene.camera.fx, scene.camera.fy, scene.camera.cx, scene.camera.cy};
  PixelSelector selector{320, 256, {.wanted = 200}};
  Window window{pinhole, 4000, {}};
  std::vector<Pose> truth;
  std::mt19937 random{7};

  Toy() {
    for (int s = 0; s < max_keyframes; ++s) window.keyframe(s).image.allocate(320, 256);
    front_end.calibrate(scene.render(Pose::Identity(), 0));
  }
  // Depths are divided and baselines multiplied by `scale`.
  void add(double t, double pose_noise, double depth_noise, double scale, double lidar_share,
           float lidar_sigma = 0.02F) {
    const Pose T = TestScene::drive(t, 2.0);
    truth.push_back(T);
    Pyramid image;
    image.allocate(320, 256);
    front_end.process(scene.render(T, 0), image);
    const auto pixels = selector.select(image, front_end.rectifier());
    std::normal_distribution<double> normal;
    Vector6d noise;
    for (int i = 0; i < 6; ++i) noise[i] = normal(random) * pose_noise * (i < 3 ? 1.0 : 0.1);
    CameraState state;
    Pose scaled = truth[0].inverse() * T;
    scaled.translation() *= scale;
    state.T_cw = (truth.size() == 1 ? Pose::Identity() : se3_exp(noise)) * (truth[0] * scaled).inverse();
    const int slot = window.add_keyframe(static_cast<std::int64_t>(truth.size()), state, image);
    for (const Pixel& pixel : pixels) {
      const double depth = scene.depth(T, pixel.u, pixel.v);
      if (depth > 40.0) continue;
      Patch patch{pixel.u, pixel.v, static_cast<float>(1.0 / (scale * depth)), 0, 0, 0, slot};
      const bool lidar = std::uniform_real_distribution<double>()(random) < lidar_share;
      if (lidar) patch.inverse_depth = static_cast<float>(1.0 / depth);  // what add_point takes as the prior's mean
      const float information = lidar ? std::pow(1.0F / (lidar_sigma * patch.inverse_depth), 2.0F) : 0.0F;
      if (!window.add_point(patch, information)) continue;
      WindowPoint& point = window.points().back();
      point.patch.inverse_depth = static_cast<float>(1.0 / (scale * depth) * (1.0 + depth_noise * normal(random)));
    }
  }
  Pose relative(int slot) const { return window.keyframe(0).state.T_cw * window.keyframe(slot).state.T_cw.inverse(); }
  double error(int slot) const {
    const Pose exact = truth[0].inverse() * truth[static_cast<std::size_t>(slot)];
    return (relative(slot).translation() - exact.translation()).norm();
  }
  double scale(int slot) const {
    const Pose exact = truth[0].inverse() * truth[static_cast<std::size_t>(slot)];
    return relative(slot).translation().norm() / exact.translation().norm();
  }
};

// What the LiDAR says of every pixel when its points are turned by `rotation`: to first order, as the window takes it.
void turn_the_lidar(Toy& toy, const Eigen::Vector3d& rotation) {
  for (WindowPoint& point : toy.window.points()) {
    const Pose& T = toy.truth[static_cast<std::size_t>(point.patch.host)];
    const double u = point.patch.u, v = point.patch.v;
    const auto inverse = [&](double du, double dv) { return 1.0 / toy.scene.depth(T, u + du, v + dv); };
    const Eigen::Vector3d ray((u - toy.pinhole.cx) / toy.pinhole.fx, (v - toy.pinhole.cy) / toy.pinhole.fy, 1.0);
    Eigen::Vector3d plane(toy.pinhole.fx * (inverse(0.5, 0) - inverse(-0.5, 0)),
                          toy.pinhole.fy * (inverse(0, 0.5) - inverse(0, -0.5)), inverse(0, 0));
    plane.z() -= plane.head<2>().dot(ray.head<2>());
    point.by_boresight = plane.cross(ray).cast<float>();
    point.prior_depth += static_cast<float>(plane.cross(ray).dot(rotation));
  }
}

// Two metres of one map find more than half of it, and how well is said; what is left goes on in the next map.
TEST(Window, ABoresightErrorIsFoundAndItsCovarianceSaysHowWell) {
  const double degree = M_PI / 180.0;
  for (const Eigen::Vector3d& wrong : {Eigen::Vector3d(0, 0.3, 0), Eigen::Vector3d(-0.2, 0.1, 0.2)}) {
    Toy toy;
    for (int i = 0; i < 6; ++i) toy.add(0.4 * i, 0.005, 0.02, 1, 1.0);
    turn_the_lidar(toy, wrong * degree);
    const Eigen::Vector3d before = toy.window.boresight_covariance().diagonal();
    toy.window.optimise(10);
    const Eigen::Vector3d error = toy.window.boresight() + wrong * degree;
    const Eigen::Vector3d after = toy.window.boresight_covariance().diagonal();
    EXPECT_LT(error.norm(), 0.5 * wrong.norm() * degree) << toy.window.boresight().transpose() / degree;
    for (int k = 0; k < 3; ++k) {
      EXPECT_LT(after[k], before[k]);
      EXPECT_LT(error[k] * error[k], 9.0 * after[k]);
    }
    const Eigen::Vector3d found = toy.window.boresight();
    toy.window.clear();
    EXPECT_EQ(toy.window.boresight(), found);
    EXPECT_LT((toy.window.prior_H() * toy.window.delta() + toy.window.prior_g()).norm(), 1e-6);
  }
}

TEST(Window, BlockEliminationKeepsTheOptimum) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  Window::Matrix A;
  for (double& value : A.reshaped()) value = normal(random);
  Window::Matrix H = A * A.transpose() + Window::Matrix::Identity();
  Window::Vector g;
  for (double& value : g) value = normal(random);
  const Window::Vector full = -H.ldlt().solve(g);
  eliminate_block(H, g, 2 * state_size);
  EXPECT_EQ((H.middleRows<state_size>(2 * state_size).norm()), 0.0);
  Eigen::MatrixXd rest(Window::dimension - state_size, Window::dimension - state_size);
  Eigen::VectorXd rest_g(rest.rows());
  Eigen::VectorXd expected(rest.rows());
  const auto index = [](Eigen::Index i) { return i < 2 * state_size ? i : i + state_size; };
  for (Eigen::Index r = 0; r < rest.rows(); ++r) {
    for (Eigen::Index c = 0; c < rest.cols(); ++c) rest(r, c) = H(index(r), index(c));
    rest_g[r] = g[index(r)];
    expected[r] = full[index(r)];
  }
  EXPECT_LT((-rest.ldlt().solve(rest_g) - expected).norm(), 1e-7 * expected.norm());
}

// Three frames: eliminating the depths point by point gives the step of the full dense system.
TEST(Window, SchurComplementEqualsTheDenseSolution) {
  Toy toy;
  toy.add(0.0, 0, 0, 1, 0);
  toy.add(0.1, 0.005, 0.02, 1, 0);
  toy.add(0.2, 0.005, 0.02, 1, 0.3);
  const Window::Normal unreduced = toy.window.linearise(false, 1e12);
  const Window::Normal reduced = toy.window.linearise(false, 0.0);
  const auto n = static_cast<Eigen::Index>(toy.window.points().size());
  const Eigen::Index m = Window::dimension;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(m + n, m + n);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(m + n);
  H.topLeftCorner(m, m) = unreduced.H;
  g.head(m) = unreduced.g;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Window::DepthBlock block = toy.window.depth_block(static_cast<std::size_t>(i));
    H(m + i, m + i) = block.H > 0.0F ? block.H : 1.0;
    if (!(block.H > 0.0F)) continue;
    g[m + i] = block.g;
    H.block(0, m + i, m, 1) = block.coupling.cast<double>();
    H.block(m + i, 0, 1, m) = block.coupling.cast<double>().transpose();
  }
  // The gauge and the unused slots are held the same way in both.
  const double hold = 1e-3 * unreduced.H.diagonal().maxCoeff();
  H.diagonal().head(m).array() += hold;
  const Eigen::VectorXd dense = -H.fullPivLu().solve(g);
  const Eigen::VectorXd schur = -(reduced.H + hold * Window::Matrix::Identity()).fullPivLu().solve(reduced.g);
  EXPECT_GT(n, 100);
  EXPECT_GT(schur.norm(), 1e-6);
  EXPECT_LT((dense.head(m) - schur).norm(), 1e-3 * schur.norm());
}

// The gradient the window descends along against differences of the residuals' weighted squares.
TEST(Window, GradientMatchesTheEnergyNumerically) {
  Toy toy;
  toy.add(0.0, 0, 0, 1, 0);
  toy.add(0.15, 0.002, 0.0, 1, 0);
  // Infinite depth damping: depths stay, the gradient is the one on poses and brightness alone. With FEJ the Jacobian
  // is exact where the state is the first estimate. The robust weight's own slope is part of the energy below: for the
  // t-distribution, d/dx of (nu + 1) log(1 + r^2 / (nu s^2)) = 2 (nu + 1) / (nu + r^2/s^2) r/s^2 dr/dx = 2 w r dr/dx.
  const Window::Normal at = toy.window.linearise(false, 1e12);
  const auto energy = [&] {
    double sum = 0.0;
    const float sigma2 = toy.window.sigma() * toy.window.sigma();
    for (const WindowPoint& point : toy.window.points()) {
      for (int t = 0; t < 2; ++t) {
        if (t == point.patch.host || point.sight[static_cast<std::size_t>(t)] != Sight::in) continue;
        const Warp warp(toy.window.keyframe(point.patch.host).state, toy.window.keyframe(t).state, toy.pinhole);
        PatchView view;
        if (!view_patch(toy.window.keyframe(t).image.level(0), warp, point.patch.u, point.patch.v,
                        point.patch.inverse_depth, 0, 0, view))
          continue;
        const Pattern r = view.value - (warp.gain * point.look.intensity + warp.offset);
        sum += static_cast<double>(
            (point.look.weight * 6.0F * (1.0F + r.square() / (5.0F * sigma2)).log()).cast<double>().sum());
      }
    }
    return sum;
  };
  for (int k : {0, 2, 4, 6, 7}) {
    const double h = k < 3 ? 2e-3 : (k < 6 ? 2e-4 : 2e-3);
    Window::Vector step = Window::Vector::Zero();
    step[state_size + k] = h;
    toy.window.apply(step);
    const double plus = energy();
    toy.window.apply(-2.0 * step);
    const double minus = energy();
    toy.window.apply(step);
    const double numeric = 0.5 * (plus - minus) / (2.0 * h);
    const double curvature = std::sqrt(at.H(state_size + k, state_size + k));
    // Image gradients are those of a smoothed interpolant: agreement to a few per cent of the curvature.
    EXPECT_NEAR(at.g[state_size + k], numeric, 0.08 * std::abs(numeric) + 3.0 * curvature) << "state " << k;
  }
}

TEST(Window, WithoutLidarSevenDirectionsAreFreeWithItSix) {
  for (double share : {0.0, 0.3}) {
    Toy toy;
    for (int i = 0; i < 4; ++i) toy.add(0.15 * i, 0, 0, 1, share);
    const Window::Normal normal = toy.window.linearise(false, 0.0);
    // A change of scale about the first keyframe: every other pose moves along its own translation.
    Window::Vector scale = Window::Vector::Zero();
    for (int s = 1; s < 4; ++s) {
      const Pose T = toy.window.keyframe(s).state.T_cw * toy.window.keyframe(0).state.T_cw.inverse();
      scale.segment<3>(s * state_size) = T.translation();
    }
    // A rigid motion of everything.
    Window::Vector rigid = Window::Vector::Zero();
    const Vector6d twist = (Vector6d() << 0.3, -0.2, 0.5, 0.1, 0.2, -0.1).finished();
    for (int s = 0; s < 4; ++s)
      rigid.segment<6>(s * state_size) = se3_adjoint(toy.window.keyframe(s).state.T_cw) * twist;
    const auto stiffness = [&](const Window::Vector& v) {
      double reference = 0.0;
      for (int i = 0; i < Window::dimension; ++i) reference += v[i] * v[i] * normal.H(i, i);
      return v.dot(normal.H * v) / reference;
    };
    EXPECT_LT(std::abs(stiffness(rigid)), 1e-4);
    if (share == 0.0) {
      EXPECT_LT(std::abs(stiffness(scale)), 1e-4);
    } else {
      EXPECT_GT(stiffness(scale), 1e-3);
    }
  }
}

TEST(Window, RefinesPosesAndDepths) {
  Toy toy;
  for (int i = 0; i < 4; ++i) toy.add(0.15 * i, 0.02, 0.1, 1, 0.3);
  const double before = toy.error(3);
  const Window::Stats stats = toy.window.optimise(10);
  EXPECT_TRUE(stats.ok);
  EXPECT_LT(toy.error(3), 0.02);
  EXPECT_LT(toy.error(3), before);
}

// As given and as said, however often pixels are counted: nothing here tells of the boresight.
TEST(Window, AnUntoldBoresightKeepsItsCovariance) {
  Toy toy;
  for (int i = 0; i < 3; ++i) toy.add(0.15 * i, 0, 0, 1, 0.3);
  toy.window.optimise(4);
  const double given = Window::Config().boresight_sigma;
  for (double variance : toy.window.boresight_covariance().diagonal())
    EXPECT_NEAR(std::sqrt(variance), given, 1e-3 * given);
}

TEST(Window, AFewAnchorsRecoverTheScale) {
  Toy toy;
  for (int i = 0; i < 4; ++i) toy.add(0.15 * i, 0, 0, 0.9, 0.05);
  EXPECT_NEAR(toy.scale(3), 0.9, 1e-6);
  toy.window.optimise(15);
  EXPECT_NEAR(toy.scale(3), 1.0, 0.02);
}

TEST(Window, MarginalisationKeepsWhatWasKnown) {
  Toy with;
  for (int i = 0; i < 5; ++i) with.add(0.15 * i, 0.01, 0.05, 1, 0.3);
  with.window.optimise(8);
  const Pose before = with.relative(4);
  const Pose newest = with.window.keyframe(4).state.T_cw;
  with.window.marginalise(0);
  with.window.marginalise(1);
  EXPECT_EQ(with.window.count(), 3);
  const Pose oldest = with.window.keyframe(2).state.T_cw;
  EXPECT_EQ(with.window.oldest(), 2);
  with.window.optimise(8);
  EXPECT_EQ((with.window.keyframe(2).state.T_cw.matrix() - oldest.matrix()).norm(), 0.0);
  // The remaining ones stay where they were although the origin is gone, and the oldest exactly.
  EXPECT_LT(se3_log(with.window.keyframe(4).state.T_cw * newest.inverse()).norm(), 0.02);
  EXPECT_GT(before.translation().norm(), 0.5);
  // And the prior is positive semidefinite.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(with.window.prior_H());
  EXPECT_GT(eigen.eigenvalues().minCoeff(), -1e-6 * eigen.eigenvalues().maxCoeff());
}

// An absolute pose in the prior would not follow when the window moves, and drive it on.
TEST(Window, ThePriorKnowsRelativePosesAlone) {
  Toy toy;
  for (int i = 0; i < 5; ++i) toy.add(0.15 * i, 0.01, 0.05, 1, 0.3);
  toy.window.optimise(8);
  toy.window.marginalise(0);
  toy.window.marginalise(1);
  Window::Vector rigid = Window::Vector::Zero();
  const Vector6d twist = (Vector6d() << 0.3, -0.2, 0.5, 0.1, 0.2, -0.1).finished();
  for (int s = 2; s < 5; ++s) rigid.segment<6>(s * state_size) = se3_adjoint(toy.window.keyframe(s).first.T_cw) * twist;
  const Window::Matrix& H = toy.window.prior_H();
  EXPECT_GT(H.norm(), 1.0);
  EXPECT_LT(std::abs(rigid.dot(H * rigid)), 1e-4 * rigid.cwiseAbs2().dot(H.diagonal()));
}

TEST(Window, AKeyframeLeftFarBehindIsGivenUpFirst) {
  Toy toy;
  Pyramid image = toy.window.keyframe(0).image;
  image.allocate(320, 256);
  CameraState far;
  far.T_cw.translation().z() = 100.0;
  toy.window.add_keyframe(0, far, image);
  for (int i = 0; i < 4; ++i) toy.add(0.15 * i, 0, 0, 1, 0.3);
  EXPECT_EQ(toy.window.least_useful(), 0);
}

TEST(Window, RescalingChangesNothingThePixelsSee) {
  Toy toy;
  for (int i = 0; i < 5; ++i) toy.add(0.15 * i, 0, 0, 1, 0);
  toy.window.optimise(4);
  toy.window.marginalise(0);
  const Pose newest = toy.window.keyframe(4).state.T_cw;
  const double energy = toy.window.linearise(false, 0.0).energy;
  const double length = toy.window.prior_H().topLeftCorner<8, 8>().norm();
  EXPECT_EQ(length, 0.0);
  toy.window.rescale(1.3);
  EXPECT_NEAR(toy.window.linearise(false, 0.0).energy, energy, 1e-3 * energy);
  EXPECT_LT(se3_log(toy.window.keyframe(4).state.T_cw * newest.inverse()).norm(), 1e-9);
}

}  // namespace
}  // namespace adit::thermal_odometry
