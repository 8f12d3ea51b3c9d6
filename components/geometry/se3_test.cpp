#include "components/geometry/se3.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

namespace adit {
namespace {

Vector6d random_twist(std::mt19937& random, double max_angle) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi[i] = unit(random);
  xi.tail<3>() *= max_angle / xi.tail<3>().norm() * std::abs(unit(random));
  return xi;
}

TEST(Se3, LogInvertsExp) {
  std::mt19937 random(1);
  for (double max_angle : {1e-10, 1e-5, 1e-2, 1.0, 3.1}) {
    for (int i = 0; i < 200; ++i) {
      const Vector6d xi = random_twist(random, max_angle);
      EXPECT_LT((se3_log(se3_exp(xi)) - xi).norm(), 1e-9) << xi.transpose();
    }
  }
}

TEST(Se3, LogAtHalfTurnHasAngleAndAxis) {
  for (const Eigen::Vector3d& axis : {Eigen::Vector3d::UnitX().eval(), Eigen::Vector3d(1, 2, -2).normalized()}) {
    const Eigen::Matrix3d r = Eigen::AngleAxisd(std::numbers::pi, axis).toRotationMatrix();
    const Eigen::Vector3d theta = so3_log(r);
    EXPECT_NEAR(theta.norm(), std::numbers::pi, 1e-9);
    EXPECT_NEAR(std::abs(theta.normalized().dot(axis)), 1.0, 1e-9);
  }
}

TEST(Se3, LeftJacobianMatchesFiniteDifferences) {
  std::mt19937 random(2);
  for (double max_angle : {1e-4, 0.3, 2.5}) {
    const Eigen::Vector3d theta = random_twist(random, max_angle).tail<3>();
    const Eigen::Matrix3d jacobian = so3_left_jacobian(theta);
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d step = 1e-6 * Eigen::Vector3d::Unit(i);
      const Eigen::Vector3d column = so3_log(so3_exp(theta + step) * so3_exp(theta - step).transpose()) / 2e-6;
      EXPECT_LT((column - jacobian.col(i)).norm(), 1e-7);
    }
    EXPECT_LT((jacobian * so3_left_jacobian_inverse(theta) - Eigen::Matrix3d::Identity()).norm(), 1e-9);
  }
}

TEST(Se3, AdjointMovesTwistsBetweenFrames) {
  std::mt19937 random(3);
  const Pose pose = se3_exp(random_twist(random, 2.0));
  const Vector6d xi = random_twist(random, 1.0);
  const Pose moved = pose * se3_exp(xi) * pose.inverse();
  EXPECT_LT((se3_exp(se3_adjoint(pose) * xi).matrix() - moved.matrix()).norm(), 1e-12);
}

TEST(Se3, InterpolationMeetsItsEndsAndHalvesTheTwist) {
  std::mt19937 random(4);
  const Pose a = se3_exp(random_twist(random, 1.0));
  const Pose b = se3_exp(random_twist(random, 1.0));
  EXPECT_LT((se3_interpolate(a, b, 0.0).matrix() - a.matrix()).norm(), 1e-12);
  EXPECT_LT((se3_interpolate(a, b, 1.0).matrix() - b.matrix()).norm(), 1e-12);
  const Pose half = se3_interpolate(a, b, 0.5);
  EXPECT_LT(((half * (a.inverse() * half)).matrix() - b.matrix()).norm(), 1e-12);
}

TEST(Se3, WrapAngleKeepsTheHalfOpenInterval) {
  EXPECT_DOUBLE_EQ(wrap_angle(3.0 * std::numbers::pi), std::numbers::pi);
  EXPECT_DOUBLE_EQ(wrap_angle(-std::numbers::pi), std::numbers::pi);
  EXPECT_NEAR(wrap_angle(7.0), 7.0 - 2.0 * std::numbers::pi, 1e-15);
}

TEST(Se3, OrthonormalizedReturnsAProperRotation) {
  std::mt19937 random(5);
  const Eigen::Matrix3d r = so3_exp(random_twist(random, 1.0).tail<3>());
  const Eigen::Matrix3d mended = orthonormalized(r + 1e-4 * Eigen::Matrix3d::Random());
  EXPECT_NEAR(mended.determinant(), 1.0, 1e-12);
  EXPECT_LT((mended - r).norm(), 1e-3);
}

}  // namespace
}  // namespace adit
