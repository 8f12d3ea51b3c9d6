#include "bringup/evaluation/decomposition.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace adit::evaluation {
namespace {

// 1000 steps of 0.5 m with a slow turn; the estimate's heading drifts by `drift` [rad] over the way, its steps are
// `scale` times too long.
std::vector<Sample> samples(double drift, double scale) {
  Trajectory truth, estimate;
  Eigen::Vector3d t(0, 0, 0), e(0, 0, 0);
  for (int i = 0; i <= 1000; ++i) {
    const double heading = 0.001 * i, error = drift * i / 1000.0;
    StampedPose a{100'000'000LL * i, Pose::Identity()}, b = a;
    a.pose.linear() = so3_exp({0, 0, heading});
    b.pose.linear() = so3_exp({0, 0, heading + error});
    a.pose.translation() = t;
    b.pose.translation() = e;
    truth.push_back(a);
    estimate.push_back(b);
    const double middle = 0.001 * (i + 0.5), off = drift * (i + 0.5) / 1000.0;
    t += 0.5 * Eigen::Vector3d(std::cos(middle), std::sin(middle), 0);
    e += 0.5 * scale * Eigen::Vector3d(std::cos(middle + off), std::sin(middle + off), 0);
  }
  return evaluate(truth, estimate)->samples;
}

TEST(Decomposition, FindsAPureHeadingError) {
  const Decomposition d = decompose(samples(0.05, 1.0));
  EXPECT_GT(d.end.total_m, 10.0);  // about 500 m times 0.025
  EXPECT_NEAR(d.end.yaw_m, d.end.total_m, 1e-4);
  EXPECT_LT(d.end.scale_m + d.end.rest_m, 1e-3);
  EXPECT_NEAR(d.yaw_share, 1.0, 1e-4);
  EXPECT_NEAR(d.speed_scale, 1.0, 1e-6);
}

TEST(Decomposition, FindsAPureScaleError) {
  const Decomposition d = decompose(samples(0.0, 1.02));
  EXPECT_GT(d.end.total_m, 9.0);
  EXPECT_NEAR(d.end.scale_m, d.end.total_m, 1e-6);
  EXPECT_LT(d.end.yaw_m + d.end.rest_m, 1e-6);
  EXPECT_NEAR(d.yaw_share, 0.0, 1e-6);
  EXPECT_NEAR(d.speed_scale, 1.0 / 1.02, 1e-9);
}

TEST(Decomposition, TakesBothApart) {
  const Decomposition both = decompose(samples(0.05, 1.02)), yaw = decompose(samples(0.05, 1.0)),
                      scale = decompose(samples(0.0, 1.02));
  EXPECT_NEAR(both.end.yaw_m, yaw.end.yaw_m, 0.03 * yaw.end.yaw_m);
  EXPECT_NEAR(both.end.scale_m, scale.end.scale_m, 1e-3);
  EXPECT_LT(both.end.rest_m, 1e-3);
}

TEST(Decomposition, OfNothingIsNothing) {
  EXPECT_TRUE(decompose({}).series.empty());
}

}  // namespace
}  // namespace adit::evaluation
