// What mode default says and does where a direction is not observed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "components/lidar_odometry/directional_information.hpp"
#include "components/lidar_odometry/lidar_odometry.hpp"
#include "components/lidar_odometry/test_scene.hpp"

namespace adit::lidar_odometry {
namespace {

struct Outcome {
  double flagged = 0.0;            // share of the sweeps whose axis is called unobservable
  double axis_degrees = 0.0;       // largest angle between the flagged direction and the tunnel
  double along = 0.0;              // m, final error along the tunnel
  double travelled = 0.0;          // m
  double across = 0.0;             // m, largest
  double degrees = 0.0;            // largest rotation error
  double axial_information = 0.0;  // 1/m^2, largest handed out along the tunnel
  double mean_solves = 0.0;
};

// At rest for 5 sweeps, then with 3 m/s^2 to 8 m/s along the tunnel. wheel: scale error of a prior; nan: no prior.
Outcome drive(const Scene& scene, int sweeps, double wheel) {
  LidarOdometry odometry(Config{});
  ScannerModel model;
  model.rings = 64;
  Outcome outcome;
  double x = 0.0;
  for (int k = 0; k < sweeps; ++k) {
    Vector6d twist = Vector6d::Zero();
    twist[0] = std::clamp(0.3 * (k - 4), 0.0, 8.0);
    x += model.period * twist[0];
    Pose truth = Pose::Identity();
    truth.translation().x() = x;
    Prior prior;
    prior.pose.translation().x() = (1.0 + wheel) * model.period * twist[0];
    const double sigma = 0.003 + 0.015 * prior.pose.translation().x();
    prior.information.diagonal() << 1.0 / (sigma * sigma), 1e4, 1e4, 1e4, 1e4, 1e4;
    const RecordedSweep sweep = scan(scene, model, truth, twist, k * 100'000'000LL, static_cast<unsigned>(k));
    const Estimate& e = odometry.process(sweep.cloud(), std::isnan(wheel) ? nullptr : &prior);
    if (k == 0) continue;
    EXPECT_TRUE(registered(e.status)) << k;
    const Vector6d error = se3_log(truth.inverse() * e.pose);
    outcome.along = error[0];
    outcome.across = std::max(outcome.across, error.segment<2>(1).norm());
    outcome.degrees = std::max(outcome.degrees, 57.3 * error.tail<3>().norm());
    outcome.mean_solves += e.scan.solves / (sweeps - 1.0);
    const Direction& weakest = e.localizability.translation[0];
    if (!weakest.observable) {
      outcome.flagged += 1.0 / (sweeps - 1.0);
      outcome.axis_degrees =
          std::max(outcome.axis_degrees, 57.3 * std::acos(std::min(1.0, std::abs(weakest.axis.x()))));
      const Eigen::Vector3d forward = e.pose.linear().transpose() * Eigen::Vector3d::UnitX();
      outcome.axial_information =
          std::max(outcome.axial_information, forward.dot(e.information.topLeftCorner<3, 3>() * forward));
    }
  }
  outcome.travelled = x;
  return outcome;
}

TEST(Degeneracy, OfASmoothTunnelIsSeenFromTheFirstSweepWithAndWithoutPrior) {
  for (const double wheel : {std::nan(""), 0.01}) {
    const Outcome outcome = drive(smooth_tunnel(), 40, wheel);
    EXPECT_GE(outcome.flagged, 0.99);
    EXPECT_LT(outcome.axis_degrees, 2.0);
    EXPECT_LT(outcome.across, 0.05);
    EXPECT_LT(outcome.degrees, 0.3);
    EXPECT_LT(outcome.axial_information, 1111.0);
  }
}

TEST(Degeneracy, ThePriorDecidesAlongASmoothTunnel) {
  for (const double wheel : {0.01, -0.01}) {
    const Outcome outcome = drive(smooth_tunnel(), 40, wheel);
    EXPECT_NEAR(outcome.along, wheel * outcome.travelled, 0.2 * 0.01 * outcome.travelled + 0.01);
  }
}

TEST(Degeneracy, NoFalseAlarmAndNoLagInAFurnishedTunnel) {
  for (const double wheel : {std::nan(""), 0.01}) {
    const Outcome outcome = drive(furnished_tunnel(), 40, wheel);
    EXPECT_LE(outcome.flagged, 0.03);
    EXPECT_LT(std::abs(outcome.along), 0.05);
    EXPECT_LT(outcome.across, 0.05);
    EXPECT_LT(outcome.degrees, 0.3);
    EXPECT_LE(outcome.mean_solves, 10.0);
  }
}

// Consistency: the mean squared error of the pose against its map, in units of the information handed out.
TEST(Degeneracy, InformationIsNotOverconfident) {
  LidarOdometry odometry(Config{});
  ScannerModel model;
  model.rings = 64;
  double squared = 0.0;
  constexpr int count = 30;
  for (int k = 0; k <= count; ++k) {
    const RecordedSweep sweep = scan(furnished_tunnel(), model, Pose::Identity(), Vector6d::Zero(), k * 100'000'000LL,
                                     static_cast<unsigned>(k));
    const Estimate& e = odometry.process(sweep.cloud());
    if (k == 0) continue;
    const Vector6d error = se3_log(e.pose);
    squared += error.dot(e.information * error) / count;
  }
  // 6 for a perfect filter; the first sweep's own noise is in the map for ever, which a fixed sensor shows fully.
  EXPECT_LT(squared, 9.0);
  EXPECT_GT(squared, 0.3);
}

// Already moving and turning at the first sweep, without a hint: the first motion is right as well, and what it claims.
// A first sweep undistorted as if at rest would leave half a sweep's way, 0.4 m.
TEST(Degeneracy, AMovingStartIsFoundAndNotOverconfident) {
  LidarOdometry odometry(Config{});
  ScannerModel model;
  model.rings = 64;
  Vector6d twist = Vector6d::Zero();
  twist[0] = 8.0;
  twist[5] = 0.1;
  Pose truth = Pose::Identity();
  for (int k = 0; k < 6; ++k) {
    if (k > 0) truth = truth * se3_exp(model.period * twist);
    const RecordedSweep sweep =
        scan(furnished_tunnel(), model, truth, twist, k * 100'000'000LL, static_cast<unsigned>(k));
    const Estimate& e = odometry.process(sweep.cloud());
    if (k == 0) continue;
    EXPECT_EQ(e.status, Status::ok) << k;
    const Vector6d error = se3_log(truth.inverse() * e.pose);
    EXPECT_LT(error.head<3>().norm(), 0.03) << k;
    EXPECT_LT(57.3 * error.tail<3>().norm(), 0.2) << k;
    EXPECT_NEAR(e.twist[0], twist[0], 0.3) << k;
    if (k > 1) continue;
    EXPECT_LT(error.dot(e.information * error), 16.8);  // 99 % of chi-square with 6 degrees of freedom
    EXPECT_GT(e.covariance(0, 0), 1e-4) << "m^2: it cannot know the acceleration";
  }
}

// The product of two independent noisy normals has no mean: a thousand walls with 2 degrees of noise are no
// information.
TEST(DirectionalInformation, OfNoiseIsNone) {
  std::vector<Constraint> constraints;
  unsigned state = 1;
  const auto noise = [&state] {
    state = state * 1664525u + 1013904223u;
    return 0.07f * (static_cast<float>(state >> 8) / 16777216.0f - 0.5f);
  };
  Matrix6d hessian = Matrix6d::Zero();
  for (int i = 0; i < 4000; ++i) {
    const float angle = 0.4f * static_cast<float>(i);
    const Eigen::Vector3f radial(0.0f, std::cos(angle), std::sin(angle));
    Constraint c;
    c.lever = 4.0f * radial + Eigen::Vector3f(0.01f * static_cast<float>(i % 2000 - 1000), 0.0f, 0.0f);
    c.map_normal = (radial + Eigen::Vector3f(noise(), 0.0f, 0.0f)).normalized();
    c.source_normal = (radial + Eigen::Vector3f(noise(), 0.0f, 0.0f)).normalized();
    c.weight = 4000.0f;
    c.cluster = static_cast<std::uint16_t>(i % static_cast<int>(image_clusters));
    Vector6d j;
    j << c.map_normal.cast<double>(), c.lever.cross(c.map_normal).cast<double>();
    hessian += 4000.0 * j * j.transpose();
    constraints.push_back(c);
  }
  DirectionalInformation analysis{SurfelConfig{}};
  const Directions directions = analysis.analyse(hessian, constraints);
  EXPECT_GT(directions.curvature[0], 3000.0);  // what the normal equations believe
  EXPECT_FALSE(directions.observable[0]);
  EXPECT_TRUE(directions.observable[1]);
  EXPECT_TRUE(directions.observable[2]);
  // And basis and coordinates are each other's inverse.
  EXPECT_LT((directions.basis * directions.to_coordinates - Matrix6d::Identity()).norm(), 1e-9);
  Vector6d gradient = Vector6d::Ones();
  Matrix6d attenuated = hessian;
  analysis.attenuate(directions, attenuated, gradient);
  const Vector6d axis = directions.basis.col(0);
  EXPECT_LT(axis.dot(attenuated * axis), 1e-6 * axis.dot(hessian * axis));
  EXPECT_NEAR(axis.dot(gradient), 0.0, 1e-9);
}

}  // namespace
}  // namespace adit::lidar_odometry
