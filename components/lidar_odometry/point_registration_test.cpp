#include "components/lidar_odometry/point_registration.hpp"

#include <gtest/gtest.h>

#include <random>

namespace adit::lidar_odometry {
namespace {

// One point a cell at most, well inside it: small motions leave each nearest point the right partner (R15).
std::vector<Eigen::Vector3d> sparse_points() {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> jitter(0.3, 0.7);
  std::vector<Eigen::Vector3d> points;
  for (int x = -10; x < 10; x += 2) {
    for (int y = -10; y < 10; y += 2) {
      for (int z = -4; z < 4; z += 2) points.emplace_back(x + jitter(random), y + jitter(random), z + jitter(random));
    }
  }
  return points;
}

Pose small_motion() {
  Vector6d xi;
  xi << 0.08, -0.05, 0.03, 0.004, -0.003, 0.006;
  return se3_exp(xi);
}

TEST(PointRegistration, RecoversAKnownMotionFromPerfectPairs) {
  const std::vector<Eigen::Vector3d> points = sparse_points();
  for (const bool far : {false, true}) {
    Pose base = Pose::Identity();
    if (far) base.translation() = Eigen::Vector3d(1e4, -2e3, 50.0);
    const Pose truth = base * small_motion();
    std::vector<Eigen::Vector3d> world;
    for (const auto& point : points) world.push_back(truth * point);
    PointMap map(1.0, 20, 0.0);
    map.add(world);
    PointRegistration registration({.max_iterations = 500, .convergence = 1e-9});
    WorkerPool pool(1);
    const auto result = registration.align(points, map, base, 1.0, 1.0, {}, pool);
    ASSERT_TRUE(result.solvable);
    const Vector6d error = se3_log(truth.inverse() * result.pose);
    EXPECT_LT(error.norm(), 1e-6) << error.transpose();
    EXPECT_EQ(result.matched, points.size());
  }
}

TEST(PointRegistration, SaysSoWhenNothingMatches) {
  PointMap map(1.0, 20, 0.0);
  map.add(std::vector<Eigen::Vector3d>{{50.0, 0.0, 0.0}});
  PointRegistration registration({});
  WorkerPool pool(1);
  const auto result = registration.align(sparse_points(), map, Pose::Identity(), 1.0, 1.0, {}, pool);
  EXPECT_FALSE(result.solvable);
  EXPECT_TRUE(result.pose.isApprox(Pose::Identity()));
}

TEST(PointRegistration, AStrongPriorHoldsAWeakOneDoesNot) {
  const std::vector<Eigen::Vector3d> points = sparse_points();
  std::vector<Eigen::Vector3d> world;
  for (const auto& point : points) world.push_back(small_motion() * point);
  PointMap map(1.0, 20, 0.0);
  map.add(world);
  PointRegistration registration({});
  WorkerPool pool(1);
  PosePrior prior;
  prior.information = 1e12 * Matrix6d::Identity();
  const auto held = registration.align(points, map, Pose::Identity(), 1.0, 1.0, prior, pool);
  EXPECT_LT(se3_log(held.pose).norm(), 1e-3);
  prior.information = 1e-6 * Matrix6d::Identity();
  const auto free = registration.align(points, map, Pose::Identity(), 1.0, 1.0, prior, pool);
  EXPECT_LT(se3_log(small_motion().inverse() * free.pose).norm(), 1e-4);
}

// The Hessian of the right perturbation is the second derivative of the cost: checked by finite differences of the
// cost that a map of exact partners gives.
TEST(PointRegistration, HessianIsOfTheRightPerturbation) {
  const std::vector<Eigen::Vector3d> points = sparse_points();
  const Pose pose = small_motion();
  std::vector<Eigen::Vector3d> world;
  for (const auto& point : points) world.push_back(pose * point);
  PointMap map(1.0, 20, 0.0);
  map.add(world);
  PointRegistration registration({});
  WorkerPool pool(1);
  const Matrix6d hessian = registration.align(points, map, pose, 1.0, 1e6, {}, pool).hessian;
  const auto cost = [&](const Vector6d& xi) {
    double sum = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i)
      sum += 0.5 * (pose * se3_exp(xi) * points[i] - world[i]).squaredNorm();
    return sum;
  };
  constexpr double h = 1e-4;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      const Vector6d a = h * Vector6d::Unit(i);
      const Vector6d b = h * Vector6d::Unit(j);
      const double derivative = (cost(a + b) - cost(a - b) - cost(b - a) + cost(-a - b)) / (4.0 * h * h);
      EXPECT_NEAR(hessian(i, j), derivative, 1e-3 * hessian.diagonal().maxCoeff());
    }
  }
}

// GenZ-ICP, eq. (9): the blend is by the shares of planar and non-planar partners.
TEST(PointRegistration, GenzBlendsByThePlanarShare) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> u(0.0, 1.0);
  std::vector<Eigen::Vector3d> wall;
  for (int i = 0; i < 4000; ++i) wall.emplace_back(4.0 * u(random), 4.0 * u(random), 1e-4 * u(random));
  std::vector<Eigen::Vector3d> clutter;
  for (int i = 0; i < 2000; ++i) clutter.emplace_back(10.0 + 2.0 * u(random), 2.0 * u(random), 2.0 * u(random));
  PointMap map(0.5, 100, 0.0);
  map.add(wall);
  map.add(clutter);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 300; ++i) points.emplace_back(1.0 + 2.0 * u(random), 1.0 + 2.0 * u(random), 0.0);
  for (int i = 0; i < 100; ++i) points.emplace_back(10.5 + u(random), 0.5 + u(random), 0.5 + u(random));
  PointRegistration registration({.planar = true, .planarity = 0.1, .max_iterations = 1});
  WorkerPool pool(1);
  const auto result = registration.align(points, map, Pose::Identity(), 0.5, 1e6, {}, pool);
  EXPECT_EQ(result.matched, 400u);
  EXPECT_EQ(result.planar, 300u);
  // At the identity: alpha * N_planar * n n^T + (1 - alpha) * N_other * I in the translation block, weights ~ 1.
  EXPECT_NEAR(result.hessian(0, 0), 0.25 * 100.0, 0.5);
  EXPECT_NEAR(result.hessian(2, 2), 0.75 * 300.0 + 0.25 * 100.0, 1.0);
}

}  // namespace
}  // namespace adit::lidar_odometry
