#include "components/state_estimator/odometry_input.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "components/state_estimator/test_support.hpp"

namespace adit::state_estimator {
namespace {

using test::kMillisecond;

RelativeMotion motion(const Pose& pose, std::int64_t from = 0, std::int64_t to = 100 * kMillisecond) {
  RelativeMotion m;
  m.from_ns = from;
  m.to_ns = to;
  m.motion = pose;
  return m;
}

OdometryConfig as_rates() {
  OdometryConfig c;
  c.relative_pose = false;
  return c;
}

TEST(OdometryInput, ArcGivesSignedSpeedAndRateAtTheMidpoint) {
  // 1 m/s backwards on a circle, 0.5 rad/s: v is the arc's speed with its sign, not the chord's length.
  const double angle = 0.05, radius = -2.0;
  const Pose arc = test::planar(radius * std::sin(angle), radius * (1 - std::cos(angle)), angle);
  Measurement m;
  ASSERT_EQ(to_measurement(motion(arc), as_rates(), 3, m), Conversion::ok);
  EXPECT_NEAR(m.value(0), -1.0, 1e-9);
  EXPECT_NEAR(m.value(1), 0.5, 1e-9);
  EXPECT_EQ(m.stamp_ns, 50 * kMillisecond);
  EXPECT_EQ(m.sensor, 3);
  EXPECT_EQ(m.rows, 2);
}

TEST(OdometryInput, ExtrinsicsRemoveTheLeverArm) {
  // The body turns on the spot; the sensor sits 0.5 m ahead, looks left, and moves sideways.
  OdometryConfig config = as_rates();
  config.body_from_sensor = test::planar(0.5, 0.2, M_PI / 2);
  const Pose body = test::planar(0.0, 0.0, 0.1);
  const Pose sensor = config.body_from_sensor.inverse() * body * config.body_from_sensor;
  Measurement m;
  ASSERT_EQ(to_measurement(motion(sensor), config, 0, m), Conversion::ok);
  EXPECT_NEAR(m.value(0), 0.0, 1e-9);
  EXPECT_NEAR(m.value(1), 1.0, 1e-9);
}

TEST(OdometryInput, RelativePoseKeepsBothInstants) {
  Measurement m;
  ASSERT_EQ(to_measurement(motion(test::planar(0.3, 0.02, 0.1)), OdometryConfig{}, 1, m), Conversion::ok);
  EXPECT_EQ(m.anchor_ns, 0);
  EXPECT_EQ(m.stamp_ns, 100 * kMillisecond);
  EXPECT_LT((m.value - Eigen::Vector3d(0.3, 0.02, 0.1)).norm(), 1e-12);
  EXPECT_EQ(m.rows, 3);
  // Configured deviations: 1 cm and 1 % of 0.3 m; 1 mrad.
  const Eigen::Matrix3d p = m.projection;
  const Eigen::Matrix3d covariance = p.inverse() * m.covariance * p.inverse().transpose();
  EXPECT_NEAR(std::sqrt(covariance(0, 0)), std::sqrt(1e-4 + 9e-6 + 1e-6), 1e-4);
  EXPECT_NEAR(std::sqrt(covariance(2, 2)), 1e-3, 1e-5);
}

TEST(OdometryInput, DegenerateAxisContributesNothing) {
  // No information along x (a smooth tunnel): two rows remain, none of them feels x.
  RelativeMotion in = motion(test::planar(1.0, 0.0, 0.0));
  Matrix6d information = Matrix6d::Identity() * 1e6;
  information(0, 0) = 0.0;
  in.information = information;
  Measurement m;
  ASSERT_EQ(to_measurement(in, OdometryConfig{}, 0, m), Conversion::ok);
  EXPECT_EQ(m.rows, 2);
  EXPECT_LT((m.projection.topRows<2>() * Eigen::Vector3d::UnitX()).norm(), 1e-9);
  EXPECT_FALSE(m.motion.has_speed);
  ASSERT_EQ(to_measurement(in, as_rates(), 0, m), Conversion::ok);
  EXPECT_EQ(m.rows, 1);
  EXPECT_NEAR(m.projection(0, 1), 1.0, 1e-12);
  // The same, 30 degrees off the body axis.
  const Eigen::Vector2d axis(std::cos(0.5236), std::sin(0.5236));
  information.topLeftCorner<2, 2>() = 1e6 * (Eigen::Matrix2d::Identity() - axis * axis.transpose());
  in.information = information;
  ASSERT_EQ(to_measurement(in, OdometryConfig{}, 0, m), Conversion::ok);
  EXPECT_EQ(m.rows, 2);
  EXPECT_LT((m.projection.topRows<2>().leftCols<2>() * axis).norm(), 1e-9);
  in.information = Matrix6d(Matrix6d::Zero());
  ASSERT_EQ(to_measurement(in, OdometryConfig{}, 0, m), Conversion::ok);
  EXPECT_EQ(m.rows, 0);
}

TEST(OdometryInput, InformationIsThatOfTheBodyMotion) {
  // Against sampling: perturb the sensor's motion with the inverse of its information, watch (dx, dy, dpsi).
  OdometryConfig config;
  config.body_from_sensor = test::planar(0.4, -0.1, 0.7);
  config.body_from_sensor.linear() = config.body_from_sensor.linear() * so3_exp({0.3, 0.2, 0.0});
  config.floor_position = config.floor_yaw = 0.0;
  Vector6d sigma;
  sigma << 0.02, 0.03, 0.05, 0.004, 0.006, 0.002;
  RelativeMotion in = motion(config.body_from_sensor.inverse() * test::planar(0.5, 0.1, 0.2) * config.body_from_sensor);
  in.information = Matrix6d(sigma.cwiseAbs2().cwiseInverse().asDiagonal());
  in.level = so3_exp({0.05, -0.03, 0.0});
  Measurement m;
  ASSERT_EQ(to_measurement(in, config, 0, m), Conversion::ok);
  ASSERT_EQ(m.rows, 3);
  const Eigen::Matrix3d covariance = m.projection.inverse() * m.covariance * m.projection.inverse().transpose();
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  constexpr int samples = 20000;
  for (int i = 0; i < samples; ++i) {
    Vector6d xi;
    for (int k = 0; k < 6; ++k) xi(k) = sigma(k) * normal(random);
    RelativeMotion noisy = in;
    noisy.motion = in.motion * se3_exp(xi);
    Measurement other;
    ASSERT_EQ(to_measurement(noisy, config, 0, other), Conversion::ok);
    const Eigen::Vector3d d = other.value - m.value;
    sum += d * d.transpose() / samples;
  }
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(sum(i, i) / covariance(i, i), 1.0, 0.06) << i;
}

TEST(OdometryInput, LevelTakesOutThePitch) {
  // Driving up a 10 degree ramp: 1 m along the body's x axis is cos(10 deg) on the plan.
  RelativeMotion in = motion(test::planar(1.0, 0.0, 0.0));
  in.level = so3_exp({0.0, -0.17453, 0.0});
  Measurement m;
  ASSERT_EQ(to_measurement(in, OdometryConfig{}, 0, m), Conversion::ok);
  EXPECT_NEAR(m.value(0), std::cos(0.17453), 1e-9);
}

TEST(OdometryInput, GuardsNameTheirReason) {
  Measurement m;
  const Pose small = test::planar(0.1, 0.0, 0.0);
  EXPECT_EQ(to_measurement(motion(small, 100, 100), OdometryConfig{}, 0, m), Conversion::bad_interval);
  EXPECT_EQ(to_measurement(motion(small, 100, 0), OdometryConfig{}, 0, m), Conversion::bad_interval);
  EXPECT_EQ(to_measurement(motion(small, 0, 2000 * kMillisecond), OdometryConfig{}, 0, m), Conversion::bad_interval);
  EXPECT_EQ(to_measurement(motion(test::planar(50, 0, 0)), OdometryConfig{}, 0, m), Conversion::implausible);
  EXPECT_EQ(to_measurement(motion(test::planar(0, 0, 2)), OdometryConfig{}, 0, m), Conversion::implausible);
  Pose bad = small;
  bad.translation().x() = std::nan("");
  EXPECT_EQ(to_measurement(motion(bad), OdometryConfig{}, 0, m), Conversion::not_finite);
  bad = small;
  bad.linear() *= 2.0;
  EXPECT_EQ(to_measurement(motion(bad), OdometryConfig{}, 0, m), Conversion::not_finite);
  RelativeMotion in = motion(small);
  in.information = Matrix6d::Constant(std::nan(""));
  EXPECT_EQ(to_measurement(in, OdometryConfig{}, 0, m), Conversion::not_finite);
}

TEST(OdometryInput, JitterIsAScaleError) {
  OdometryConfig config = as_rates();
  config.sigma_speed = 1e-6;
  config.stamp_jitter_s = 0.001;
  Measurement m;
  ASSERT_EQ(to_measurement(motion(test::planar(1.0, 0, 0)), config, 0, m), Conversion::ok);
  EXPECT_NEAR(std::sqrt(m.covariance(0, 0)), 0.1, 1e-6);  // 1 ms of 0.1 s at 10 m/s
}

TEST(OdometryInput, CovariancesOfAllKinds) {
  EXPECT_FALSE(information_from_covariance(Matrix6d::Zero()));
  EXPECT_FALSE(information_from_covariance(Matrix6d::Constant(std::nan(""))));
  EXPECT_FALSE(information_from_covariance(Matrix6d::Constant(std::numeric_limits<double>::infinity())));
  EXPECT_FALSE(information_from_covariance(-Matrix6d::Identity()));
  const auto unit = information_from_covariance(4.0 * Matrix6d::Identity());
  ASSERT_TRUE(unit);
  EXPECT_LT((*unit - 0.25 * Matrix6d::Identity()).norm(), 1e-12);
  Matrix6d huge = Matrix6d::Identity();
  huge(0, 0) = 1e300;
  const auto partial = information_from_covariance(huge);
  ASSERT_TRUE(partial);
  EXPECT_TRUE(partial->allFinite());
  EXPECT_NEAR((*partial)(0, 0), 0.0, 1e-12);
  EXPECT_NEAR((*partial)(1, 1), 1.0, 1e-12);
}

}  // namespace
}  // namespace adit::state_estimator
