#include "bringup/evaluation/centre_line.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace adit::evaluation {
namespace {

Pose at(double x, double y, double heading) {
  Pose pose = Pose::Identity();
  pose.linear() = so3_exp({0, 0, heading});
  pose.translation() = Eigen::Vector3d(x, y, 0);
  return pose;
}

// A quarter circle of 100 m around the origin, from (100, 0) to (0, 100).
std::vector<Eigen::Vector2d> arc() {
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i <= 1000; ++i) points.emplace_back(100 * std::cos(M_PI / 2000 * i), 100 * std::sin(M_PI / 2000 * i));
  return points;
}

TEST(CentreLine, MeasuresAlongAndAcrossTheBend) {
  const CentreLine line(arc());
  const double here = 0.3, ahead = 0.8;  // rad along the arc: 50 m apart
  const CentreLine::Split split = line.split(at(100 * std::cos(here), 100 * std::sin(here), here + M_PI / 2),
                                             {98 * std::cos(ahead), 98 * std::sin(ahead), 0});
  EXPECT_NEAR(split.axial_m, 50.0, 0.01);
  EXPECT_NEAR(split.lateral_m, 2.0, 0.01);  // inside of a left-hand bend: left
}

TEST(CentreLine, DrivenBackwardsTurnsBothSigns) {
  const CentreLine line(arc());
  const CentreLine::Split split = line.split(at(100 * std::cos(0.3), 100 * std::sin(0.3), 0.3 - M_PI / 2),
                                             {98 * std::cos(0.8), 98 * std::sin(0.8), 0});
  EXPECT_NEAR(split.axial_m, -50.0, 0.01);
  EXPECT_NEAR(split.lateral_m, -2.0, 0.01);
}

TEST(CentreLine, GoesOnStraightBeyondItsEnds) {
  const CentreLine line({{0, 0}, {10, 0}});
  const CentreLine::Split split = line.split(at(12, 1, 0), {-3, 4, 0});
  EXPECT_NEAR(split.axial_m, -15.0, 1e-12);
  EXPECT_NEAR(split.lateral_m, 3.0, 1e-12);
}

TEST(CentreLine, ChoosesTheTubeTheTruthIsIn) {
  // There along y = 0, back along y = 10; the truth stands nearer to the other tube's line than the estimate.
  const CentreLine line({{0, 0}, {100, 0}, {100, 10}, {0, 10}});
  const CentreLine::Split split = line.split(at(50, 1, 0), {53, 2, 0});
  EXPECT_NEAR(split.axial_m, 3.0, 1e-12);
  EXPECT_NEAR(split.lateral_m, 1.0, 1e-12);
}

TEST(CentreLine, WithoutALineTheHeadingSplits) {
  const CentreLine line({{1, 1}, {1, 1}});
  const CentreLine::Split split = line.split(at(0, 0, M_PI / 2), {-1, 2, 0});
  EXPECT_NEAR(split.axial_m, 2.0, 1e-12);
  EXPECT_NEAR(split.lateral_m, 1.0, 1e-12);
}

}  // namespace
}  // namespace adit::evaluation
