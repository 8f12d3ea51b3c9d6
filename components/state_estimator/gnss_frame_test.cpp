#include "components/state_estimator/gnss_frame.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace adit::state_estimator {
namespace {

Eigen::Vector2d turned(const Eigen::Vector2d& v, double a) {
  return {std::cos(a) * v.x() - std::sin(a) * v.y(), std::sin(a) * v.x() + std::cos(a) * v.y()};
}

TEST(GnssFrame, MetresOfADegree) {
  const Geodetic origin{45.0, 10.0, 0.0};
  // Lengths of a degree at 45 degrees: 111131.8 m along the meridian, 78846.8 m along the parallel (WGS 84).
  EXPECT_NEAR(to_local(origin, {45.001, 10.0, 0.0}).y(), 111.1318, 1e-3);
  EXPECT_NEAR(to_local(origin, {45.0, 10.001, 0.0}).x(), 78.8468, 1e-3);
  EXPECT_NEAR(to_local(origin, {45.0, 10.0, 7.0}).z(), 7.0, 1e-6);
}

TEST(GnssFrame, FindsHowOdomLies) {
  GnssFrame frame({.baseline_m = 40.0, .max_sigma_m = 0.5, .max_pairs = 2000});
  const Eigen::Vector2d origin(120.0, -30.0);
  const double heading = 2.1;
  bool done = false;
  int used = 0;
  for (int i = 0; !done && i < 100; ++i) {
    const Eigen::Vector2d odom(0.5 * i, 0.01 * i * i / 10.0);
    EXPECT_FALSE(frame.aligned());
    EXPECT_FALSE(frame.add({1e3, 1e3}, 2.0, odom));  // a poor fix takes no part
    done = frame.add(origin + turned(odom, heading), 0.02, odom);
    ++used;
  }
  ASSERT_TRUE(done);
  EXPECT_GT(used, 70);
  EXPECT_NEAR(frame.heading(), heading, 1e-9);
  const GnssFrame::Fix fix =
      frame.to_odom(origin + turned({500.0, 20.0}, heading), Eigen::Vector2d(1.0, 4.0).asDiagonal());
  EXPECT_LT((fix.position - Eigen::Vector2d(500.0, 20.0)).norm(), 1e-6);
  const Eigen::Matrix2d r =
      (Eigen::Matrix2d() << std::cos(heading), -std::sin(heading), std::sin(heading), std::cos(heading)).finished();
  const Eigen::Matrix2d bare = r.transpose() * Eigen::Vector2d(1.0, 4.0).asDiagonal() * r;
  EXPECT_GT(fix.covariance(1, 1), bare(1, 1));  // far ahead, the turn's uncertainty shows across
  EXPECT_LT(fix.covariance(1, 1), bare(1, 1) + 1.0);
}

TEST(GnssFrame, KnownFramesNeedNoWay) {
  GnssFrame frame({});
  frame.set({10.0, 0.0}, M_PI / 2);
  ASSERT_TRUE(frame.aligned());
  const GnssFrame::Fix fix = frame.to_odom({10.0, 5.0}, Eigen::Matrix2d::Identity());
  EXPECT_LT((fix.position - Eigen::Vector2d(5.0, 0.0)).norm(), 1e-12);
  EXPECT_LT((fix.covariance - Eigen::Matrix2d::Identity()).norm(), 1e-12);
}

}  // namespace
}  // namespace adit::state_estimator
