#include "components/lidar_odometry/localizability.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include <Eigen/Cholesky>

namespace adit::lidar_odometry {
namespace {

// Information of points with normals, each measured to 2 cm along its normal.
Matrix6d information_of(const std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>& points) {
  Matrix6d information = Matrix6d::Zero();
  for (const auto& [p, n] : points) {
    Vector6d j;
    j << n, p.cross(n);
    information += j * j.transpose() / (0.02 * 0.02);
  }
  return information;
}

using Points = std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>;

Points plane() {
  Points points;
  for (int i = -10; i <= 10; ++i) {
    for (int j = -10; j <= 10; ++j) points.push_back({{0.5 * i, 0.5 * j, -1.5}, {0.0, 0.0, 1.0}});
  }
  return points;
}

Points box() {
  Points points;
  for (int i = -10; i <= 10; ++i) {
    for (int j = -10; j <= 10; ++j) {
      for (int axis = 0; axis < 3; ++axis) {
        Eigen::Vector3d p, n = Eigen::Vector3d::Unit(axis);
        p[axis] = 5.0;
        p[(axis + 1) % 3] = 0.5 * i;
        p[(axis + 2) % 3] = 0.5 * j;
        points.push_back({p, n});
        points.push_back({-p, -n});
      }
    }
  }
  return points;
}

// Radius 4 m about x; narrowing > 0: a cone.
Points tunnel(double narrowing) {
  Points points;
  for (int i = -20; i <= 20; ++i) {
    for (int a = 0; a < 72; ++a) {
      const double angle = a * 2.0 * M_PI / 72.0;
      const double radius = 4.0 - narrowing * i;
      const Eigen::Vector3d radial(0.0, std::cos(angle), std::sin(angle));
      points.push_back({Eigen::Vector3d(i, 0.0, 0.0) + radius * radial, Eigen::Vector3d(narrowing, 0, 0) + radial});
      points.back().second.normalize();
    }
  }
  return points;
}

Points sphere() {
  Points points;
  for (const auto& [p, n] : box()) points.push_back({5.0 * p.normalized(), p.normalized()});
  return points;
}

TEST(Localizability, OfABoxIsComplete) {
  const Localizability l = localizability(information_of(box()), {});
  EXPECT_EQ(l.unobservable(), 0);
}

TEST(Localizability, OfAPlaneIsHeightAndTwoTilts) {
  const Localizability l = localizability(information_of(plane()), {});
  EXPECT_EQ(l.unobservable(), 3);
  EXPECT_TRUE(l.translation[2].observable);
  EXPECT_NEAR(std::abs(l.translation[2].axis.z()), 1.0, 1e-9);
  EXPECT_FALSE(l.rotation[0].observable);
  EXPECT_NEAR(std::abs(l.rotation[0].axis.z()), 1.0, 1e-9);
}

TEST(Localizability, OfATunnelLacksTheAxisAndTheRollAboutIt) {
  const Localizability l = localizability(information_of(tunnel(0.0)), {});
  EXPECT_EQ(l.unobservable(), 2);
  EXPECT_FALSE(l.translation[0].observable);
  EXPECT_NEAR(std::abs(l.translation[0].axis.x()), 1.0, 1e-9);
  EXPECT_NEAR(std::abs(l.rotation[0].axis.x()), 1.0, 1e-9);
}

TEST(Localizability, OfAConeHasTheAxis) {
  const Localizability l = localizability(information_of(tunnel(0.1)), {});
  EXPECT_EQ(l.unobservable(), 1);
  EXPECT_FALSE(l.rotation[0].observable);
}

TEST(Localizability, OfASphereLacksAllRotations) {
  const Localizability l = localizability(information_of(sphere()), {});
  EXPECT_EQ(l.unobservable(), 3);
  for (const Direction& d : l.translation) EXPECT_TRUE(d.observable);
}

TEST(Localizability, SchurComplementIsTheInverseOfTheMarginalCovariance) {
  const Matrix6d information = information_of(box()) + information_of(tunnel(0.1));
  const Matrix6d covariance = information.ldlt().solve(Matrix6d::Identity());
  for (int first : {0, 3}) {
    const Eigen::Matrix3d marginal = covariance.block<3, 3>(first, first);
    const Eigen::Matrix3d schur = schur_complement(information, first);
    EXPECT_LT((schur * marginal - Eigen::Matrix3d::Identity()).norm(), 1e-8);
  }
}

TEST(BoundedCovariance, IsPositiveDefiniteForAnyInformation) {
  for (const Matrix6d& information :
       {Matrix6d(Matrix6d::Zero()), information_of(plane()), information_of(tunnel(0.0))}) {
    const Matrix6d covariance = bounded_covariance(information);
    EXPECT_TRUE(covariance.allFinite());
    EXPECT_GT(Eigen::LLT<Matrix6d>(covariance).matrixLLT().diagonal().minCoeff(), 0.0);
    EXPECT_LE(covariance.diagonal().head<3>().maxCoeff(), 101.0);
  }
}

}  // namespace
}  // namespace adit::lidar_odometry
