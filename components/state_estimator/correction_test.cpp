#include "components/state_estimator/correction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include <Eigen/Dense>

#include "components/state_estimator/filter.hpp"
#include "components/state_estimator/measurement_models.hpp"
#include "components/state_estimator/test_support.hpp"

namespace adit::state_estimator {
namespace {

FilterState random_state(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  FilterState s;
  s.stamp_ns = 0;
  StateMatrix a;
  for (int i = 0; i < kStates; ++i) {
    s.x(i) = normal(random);
    for (int j = 0; j < kStates; ++j) a(i, j) = 0.3 * normal(random);
  }
  s.p = a * a.transpose();
  return s;
}

double least_eigenvalue_ratio(const StateMatrix& p) {
  // Relative to the states' own deviations, so that metres and radians do not hide each other.
  StateVector scale;
  for (int i = 0; i < kStates; ++i) scale(i) = p(i, i) > 0.0 ? 1.0 / std::sqrt(p(i, i)) : 1.0;
  const Eigen::SelfAdjointEigenSolver<StateMatrix> solver(scale.asDiagonal() * p * scale.asDiagonal(),
                                                          Eigen::EigenvaluesOnly);
  return solver.eigenvalues()(0);
}

TEST(Correction, ChiSquareTable) {
  EXPECT_NEAR(chi_square(2, Quantile::p99_9), 13.8155, 1e-4);
  EXPECT_NEAR(chi_square(1, Quantile::p95), 3.8415, 1e-4);
  EXPECT_NEAR(chi_square(3, Quantile::p99), 11.3449, 1e-4);
}

TEST(Correction, EqualsTheInformationForm) {
  std::mt19937_64 random(1);
  for (int trial = 0; trial < 50; ++trial) {
    FilterState s = random_state(random);
    s.p += 0.1 * StateMatrix::Identity();
    s.x(kYaw) = 0.1;
    const Measurement m = test::rates(0, 0, 1.0, 0.2, 0.3, 0.05);
    const Innovation innovation = project(SpeedAndYawRate().linearize(s, m), m);
    const auto h = innovation.jacobian.topRows<2>();
    const Eigen::Matrix2d r = innovation.covariance.topLeftCorner<2, 2>();
    const StateMatrix information = s.p.inverse() + h.transpose() * r.inverse() * h;
    const StateMatrix p = information.inverse();
    const StateVector x = s.x + p * h.transpose() * r.inverse() * innovation.value.head<2>();
    ASSERT_TRUE(correct(s, innovation));
    EXPECT_LT((s.p - p).norm(), 1e-9);
    for (int i = 0; i < kFirstClone; ++i) {
      if (i != kYaw) {
        EXPECT_NEAR(s.x(i), x(i), 1e-9);
      }
    }
    EXPECT_NEAR(wrap_angle(s.x(kYaw) - x(kYaw)), 0.0, 1e-9);
  }
}

TEST(Correction, DistanceByHand) {
  FilterState s;
  s.p(kSpeed, kSpeed) = 3.0;
  s.p(kYawRate, kYawRate) = 0.01;
  const Measurement m = test::rates(0, 0, 4.0, 0.0, 1.0, 0.1);
  const Innovation i = project(SpeedAndYawRate().linearize(s, m), m);
  EXPECT_NEAR(squared_distance(s, i), 4.0, 1e-12);  // 4^2 / (3 + 1)
}

TEST(Correction, RefusesWhatIsNotANumberAndChangesNothing) {
  std::mt19937_64 random(2);
  FilterState s = random_state(random);
  const FilterState before = s;
  Measurement m = test::rates(0, 0, std::nan(""), 0.2, 0.3, 0.05);
  EXPECT_FALSE(correct(s, project(SpeedAndYawRate().linearize(s, m), m)));
  m = test::rates(0, 0, 1.0, 0.2, 0.3, 0.05);
  m.covariance *= -1e6;
  EXPECT_FALSE(correct(s, project(SpeedAndYawRate().linearize(s, m), m)));
  m.covariance.setConstant(std::numeric_limits<double>::infinity());
  EXPECT_FALSE(correct(s, project(SpeedAndYawRate().linearize(s, m), m)));
  m.rows = 0;
  EXPECT_FALSE(correct(s, project(SpeedAndYawRate().linearize(s, m), m)));
  EXPECT_EQ((s.x - before.x).norm(), 0.0);
  EXPECT_EQ((s.p - before.p).norm(), 0.0);
}

TEST(Correction, AnglesStayWrapped) {
  FilterState s;
  s.x(kYaw) = 3.1;
  s.p(kYaw, kYaw) = s.p(kYawRate, kYawRate) = 1.0;
  s.p(kYaw, kYawRate) = s.p(kYawRate, kYaw) = 0.99;
  const Measurement m = test::rates(0, 0, 0.0, 0.3, 1.0, 0.01);
  ASSERT_TRUE(correct(s, project(SpeedAndYawRate().linearize(s, m), m)));
  EXPECT_LT(s.x(kYaw), 0.0);
  EXPECT_GT(s.x(kYaw), -M_PI);
}

// Updates with covariances over 24 decades, predictions and clones in between.
void stays_positive(int updates) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> exponent(-12.0, 12.0), uniform(-1.0, 1.0);
  std::uniform_int_distribution<int> kind(0, 5);
  const SpeedAndYawRate speed({.scale = true, .yaw_bias = true});
  const PlanarRelativePose relative(0);
  const GnssPosition gnss({0.3, 0.1});
  const ImuYawRateAndAcceleration imu({0.2, 0.0});
  ProcessConfig process;
  FilterState s;
  s.stamp_ns = 0;
  s.p.diagonal().head<kFirstClone>().setConstant(0.1);
  s.clone(0);
  double worst = 1.0;
  int used = 0;
  for (int i = 0; i < updates; ++i) {
    predict(s, s.stamp_ns + 1 + static_cast<std::int64_t>(3e7 * std::abs(uniform(random))), process);
    Measurement m;
    m.stamp_ns = s.stamp_ns;
    m.anchor_ns = s.clone_stamp_ns[0];
    m.rows = 2;
    const MeasurementModel* model = nullptr;
    switch (kind(random)) {
      case 0:
        model = &gnss;
        break;
      case 1:
        model = &imu;
        break;
      case 2:
        model = &relative;
        m.rows = 3;
        break;
      case 3:
        s.clone(0);
        continue;
      default:
        model = &speed;
    }
    const double a = std::pow(10.0, exponent(random)), b = std::pow(10.0, exponent(random));
    m.covariance = Eigen::Vector3d(a, b, std::pow(10.0, exponent(random))).asDiagonal();
    const Linearization l = model->linearize(s, m);
    Innovation innovation = project(l, m);
    innovation.value = 0.3 * Eigen::Vector3d(uniform(random), uniform(random), uniform(random));
    used += correct(s, innovation) ? 1 : 0;
    // The random innovations carry the state off: bring it back, the covariance is what is under test.
    s.x = s.x.cwiseMin(20.0).cwiseMax(-20.0);
    s.x(kScale) = std::clamp(s.x(kScale), -0.5, 0.5);
    if (i % 50 == 0) {
      worst = std::min(worst, least_eigenvalue_ratio(s.p));
      ASSERT_TRUE(s.p.allFinite());
      ASSERT_EQ((s.p - s.p.transpose()).cwiseAbs().maxCoeff(), 0.0);
      ASSERT_GE(s.p.diagonal().minCoeff(), 0.0) << i;
      if (s.p(kX, kX) > 1e6) s.p.setIdentity();
    }
  }
  std::printf("%d updates, %d used, least eigenvalue %.2e of the scaled covariance\n", updates, used, worst);
  EXPECT_GT(used, updates / 2);
  EXPECT_GT(worst, -1e-9);
}

TEST(Correction, RandomUpdatesStayPositive) {
  stays_positive(100'000);
}
TEST(Correction, DISABLED_MillionRandomUpdatesStayPositive) {
  stays_positive(1'000'000);
}

}  // namespace
}  // namespace adit::state_estimator
