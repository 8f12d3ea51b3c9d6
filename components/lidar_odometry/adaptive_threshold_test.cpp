#include "components/lidar_odometry/adaptive_threshold.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace adit::lidar_odometry {
namespace {

Pose shifted(double x) {
  Pose pose = Pose::Identity();
  pose.translation().x() = x;
  return pose;
}

TEST(AdaptiveThreshold, KissCountsTheInitialValueAsASample) {
  AdaptiveThreshold threshold(AdaptiveThreshold::Rule::kiss, 2.0, 0.1, 100.0);
  EXPECT_DOUBLE_EQ(threshold.sigma(0.0), 2.0);
  threshold.add(Pose::Identity(), shifted(0.09));  // below min_motion: not counted
  EXPECT_DOUBLE_EQ(threshold.sigma(0.0), 2.0);
  threshold.add(Pose::Identity(), shifted(0.5));
  EXPECT_DOUBLE_EQ(threshold.sigma(0.0), std::sqrt((4.0 + 0.25) / 2.0));
  threshold.reset();
  EXPECT_DOUBLE_EQ(threshold.sigma(0.0), 2.0);
}

TEST(AdaptiveThreshold, GenzKeepsTheInitialValueNearTheStart) {
  AdaptiveThreshold threshold(AdaptiveThreshold::Rule::genz, 2.0, 0.1, 100.0);
  threshold.add(Pose::Identity(), shifted(0.5));
  threshold.add(Pose::Identity(), shifted(0.3));
  EXPECT_DOUBLE_EQ(threshold.sigma(0.5), 2.0);
  EXPECT_DOUBLE_EQ(threshold.sigma(0.51), std::sqrt((0.25 + 0.09) / 2.0));
}

TEST(AdaptiveThreshold, RotationCountsAsWhatItMovesAtMaxRange) {
  AdaptiveThreshold threshold(AdaptiveThreshold::Rule::genz, 2.0, 0.1, 50.0);
  Pose turned = shifted(0.2);
  turned.linear() = so3_exp({0.0, 0.0, 0.01});
  threshold.add(Pose::Identity(), turned);
  EXPECT_NEAR(threshold.sigma(10.0), 0.2 + 2.0 * 50.0 * std::sin(0.005), 1e-9);
}

}  // namespace
}  // namespace adit::lidar_odometry
