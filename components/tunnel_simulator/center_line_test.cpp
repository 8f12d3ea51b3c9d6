#include "components/tunnel_simulator/center_line.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "components/tunnel_simulator/route.hpp"

namespace adit::tunnel_simulator {
namespace {

CenterLine s_curve() {
  return CenterLine({10.0, -5.0, 3.0, 0.4}, {{100.0, 0.0, 0.0, 0.01},
                                             {60.0, 0.0, 1.0 / 300.0, 0.01},
                                             {200.0, 1.0 / 300.0, 1.0 / 300.0, -0.02, 30.0},
                                             {60.0, 1.0 / 300.0, -1.0 / 500.0, -0.02},
                                             {150.0, -1.0 / 500.0, -1.0 / 500.0, 0.03, 40.0}});
}

TEST(CenterLine, ArcIsTheCircle) {
  const CenterLine arc({0.0, 0.0, 0.0, 0.0}, {{250.0, 1.0 / 100.0, 1.0 / 100.0}});
  for (double s : {0.0, 0.7, 33.3, 157.0796, 249.9}) {
    const LinePoint p = arc.at(s);
    EXPECT_NEAR(p.position.x(), 100.0 * std::sin(s / 100.0), 1e-10);
    EXPECT_NEAR(p.position.y(), 100.0 * (1.0 - std::cos(s / 100.0)), 1e-10);
    EXPECT_NEAR(p.heading, s / 100.0, 1e-13);
  }
}

TEST(CenterLine, ClothoidMatchesItsSeries) {
  // Fresnel series of a clothoid of parameter A^2 = R L, third order: x = s - s^5 / (40 A^4) + s^9 / (3456 A^8),
  // y = s^3 / (6 A^2) - s^7 / (336 A^6) + s^11 / (42240 A^10).
  const CenterLine line({}, {{60.0, 0.0, 1.0 / 200.0}});
  const double a2 = 200.0 * 60.0;
  for (double s : {10.0, 35.0, 60.0}) {
    const double x = s - std::pow(s, 5) / (40.0 * a2 * a2) + std::pow(s, 9) / (3456.0 * std::pow(a2, 4));
    const double y = std::pow(s, 3) / (6.0 * a2) - std::pow(s, 7) / (336.0 * std::pow(a2, 3)) +
                     std::pow(s, 11) / (42240.0 * std::pow(a2, 5));
    EXPECT_NEAR(line.at(s).position.x(), x, 1e-7);
    EXPECT_NEAR(line.at(s).position.y(), y, 1e-7);
  }
}

TEST(CenterLine, GradeIntegratesToHeight) {
  const CenterLine line = s_curve();
  double z = line.at(0.0).position.z();
  const int steps = 57000;
  const double step = line.length() / steps;
  for (int i = 0; i < steps; ++i) z += step * line.at((i + 0.5) * step).grade;
  EXPECT_NEAR(z, line.at(line.length()).position.z(), 1e-6);
}

TEST(CenterLine, ProjectInvertsPoint) {
  const CenterLine line = s_curve();
  for (double s = 1.0; s < line.length(); s += 17.3) {
    for (double l : {-6.0, 0.0, 4.5}) {
      const LineCoordinates c = line.project(line.point(s, l, 2.5));
      EXPECT_NEAR(c.s, s, 1e-8);
      EXPECT_NEAR(c.l, l, 1e-8);
      EXPECT_NEAR(c.h, 2.5, 1e-8);
    }
  }
}

TEST(CenterLine, ParallelKeepsItsDistance) {
  const CenterLine line = s_curve();
  const CenterLine other = line.parallel(-25.0);
  for (double s = 1.0; s < other.length(); s += 11.0) {
    EXPECT_NEAR(line.project(other.at(s).position).l, -25.0, 0.02);
  }
}

TEST(Route, IsSmoothAndParametrizedByArcLength) {
  const CenterLine line = s_curve();
  // Out on the right lane, back on the other: two joins, one a turn about.
  const Route route({{line, 5.0, 300.0, -1.75}, {line, 300.0, 5.0, -15.0}}, true);
  const double h = 1e-3;
  for (double d = 0.0; d < 2.0 * route.length(); d += 3.1) {
    const Eigen::Vector3d before = route.at(d - h).position;
    const Eigen::Vector3d after = route.at(d + h).position;
    EXPECT_NEAR((after - before).norm() / (2.0 * h), 1.0, 1e-6) << d;
    EXPECT_LT((route.at(d).tangent - (after - before) / (2.0 * h)).norm(), 1e-5) << d;
    EXPECT_LT((route.at(d + h).tangent - route.at(d - h).tangent).norm(), 2.0 * h / 4.0) << d;  // radius above 4 m
  }
}

TEST(Route, CurvatureIsTheTangentsTurn) {
  const CenterLine line = s_curve();
  const Route route({{line, 150.0, 350.0, 2.0}, {line, 360.0, 500.0, -1.0}}, false);
  const double h = 1e-3;
  for (double d = 1.0; d < route.length() - 1.0; d += 2.7) {
    const Eigen::Vector3d a = route.at(d - h).tangent;
    const Eigen::Vector3d b = route.at(d + h).tangent;
    const double turn = std::atan2(a.x() * b.y() - a.y() * b.x(), a.head<2>().dot(b.head<2>())) / (2.0 * h);
    EXPECT_NEAR(route.at(d).curvature, turn, 2e-4) << d;
  }
}

}  // namespace
}  // namespace adit::tunnel_simulator
