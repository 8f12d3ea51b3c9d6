#include "components/state_estimator/map_correction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace adit::state_estimator {
namespace {

const Eigen::Matrix3d kSmall = Eigen::Vector3d(1e-4, 1e-4, 1e-6).asDiagonal();

TEST(MapCorrection, ComposeAndInverse) {
  const PlanarPose a(1.0, 2.0, 3.0), b(-0.5, 0.7, 2.0);
  EXPECT_LT(compose(a, inverse(a)).norm(), 1e-12);
  EXPECT_LT((compose(inverse(a), compose(a, b)) - b).norm(), 1e-12);
}

TEST(MapCorrection, FirstClosurePlacesOdomInMap) {
  MapCorrection map;
  const PlanarPose odom(10.0, 1.0, 0.4), truth(110.0, 53.0, -1.2);
  ASSERT_EQ(map.add(truth, kSmall, odom, Eigen::Matrix3d::Identity()), MapCorrection::Outcome::applied);
  EXPECT_LT((compose(map.map_odom(), odom) - truth).norm(), 1e-12);
}

TEST(MapCorrection, ClosuresAverageAndFollowTheDrift) {
  std::mt19937_64 random(8);
  std::normal_distribution<double> normal;
  MapCorrection map;
  PlanarPose truth_map_odom(3.0, -2.0, 0.3);
  const Eigen::Matrix3d drift = Eigen::Vector3d(1e-3, 1e-3, 1e-6).asDiagonal();
  double squares = 0.0;
  for (int i = 0; i < 300; ++i) {
    const PlanarPose odom(0.5 * i, 10.0 * std::sin(0.02 * i), 0.01 * i);
    truth_map_odom += PlanarPose(0.03 * normal(random), 0.03 * normal(random), 0.0);
    PlanarPose seen = compose(truth_map_odom, odom);
    seen += PlanarPose(0.1 * normal(random), 0.1 * normal(random), 0.01 * normal(random));
    ASSERT_NE(map.add(seen, Eigen::Vector3d(0.01, 0.01, 1e-4).asDiagonal(), odom, drift),
              MapCorrection::Outcome::malformed);
    if (i > 100) squares += (compose(map.map_odom(), odom) - compose(truth_map_odom, odom)).head<2>().squaredNorm();
  }
  EXPECT_LT(std::sqrt(squares / 199.0), 0.11);  // better than one closure, 0.14 m in the plane
  EXPECT_LT(map.rejected(), 3u);
}

TEST(MapCorrection, FalseClosureIsRejected) {
  MapCorrection map;
  ASSERT_EQ(map.add({0, 0, 0}, kSmall, {0, 0, 0}, kSmall), MapCorrection::Outcome::applied);
  // The parallel tube, 20 m beside, after little drift.
  EXPECT_EQ(map.add({50, 20, 0}, kSmall, {50, 0, 0}, kSmall), MapCorrection::Outcome::rejected);
  EXPECT_EQ(map.add({50.01, 0, 0}, kSmall, {50, 0, 0}, kSmall), MapCorrection::Outcome::applied);
  EXPECT_EQ(map.add({std::nan(""), 0, 0}, kSmall, {50, 0, 0}, kSmall), MapCorrection::Outcome::malformed);
  EXPECT_EQ(map.add({50, 0, 0}, -kSmall, {50, 0, 0}, -kSmall), MapCorrection::Outcome::malformed);
  EXPECT_EQ(map.rejected(), 1u);
  EXPECT_EQ(map.applied(), 2u);
}

}  // namespace
}  // namespace adit::state_estimator
