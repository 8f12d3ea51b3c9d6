#include "bringup/evaluation/outage_growth.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace adit::evaluation {
namespace {

constexpr std::int64_t second = 1'000'000'000;

// Drives along x with 10 m/s, the estimate with 9 m/s from 4 s to 6 s, in a frame that is turned and shifted.
Evaluation drive() {
  Evaluation e;
  Pose frame = Pose::Identity();
  frame.linear() = Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  frame.translation() = Eigen::Vector3d(3.0, -2.0, 0.5);
  for (int i = 0; i <= 100; ++i) {
    const double t = 0.1 * i;
    Sample& s = e.samples.emplace_back();
    s.stamp_ns = std::llround(t * 1e9);
    s.distance_m = 10.0 * t;
    s.truth.translation().x() = 10.0 * t;
    s.estimate.translation().x() = 10.0 * t - std::clamp(t - 4.0, 0.0, 2.0);
    s.estimate = frame * s.estimate;
  }
  return e;
}

TEST(OutageGrowth, IsTheErrorOfTheMotionBetweenStartAndEndOfEachSpanOnce) {
  const std::pair<std::int64_t, std::int64_t> spans[] = {
      {3 * second, 7 * second}, {3 * second, 7 * second}, {5 * second, 6 * second}, {7 * second, 9 * second}};
  const std::vector<OutageGrowth> growth = outage_growth(drive(), spans);
  ASSERT_EQ(growth.size(), 3u);
  EXPECT_NEAR(growth[0].error_m, 2.0, 1e-9);
  EXPECT_NEAR(growth[0].distance_m, 40.0, 1e-9);
  EXPECT_NEAR(growth[1].error_m, 1.0, 1e-9);
  EXPECT_NEAR(growth[2].error_m, 0.0, 1e-9);  // what was lost before does not count
}

TEST(OutageGrowth, NothingOfASpanTheEstimateDoesNotCover) {
  const std::pair<std::int64_t, std::int64_t> spans[] = {{5 * second, 11 * second}, {12 * second, 13 * second}};
  EXPECT_TRUE(outage_growth(drive(), spans).empty());
  EXPECT_TRUE(outage_growth(Evaluation{}, spans).empty());
}

}  // namespace
}  // namespace adit::evaluation
