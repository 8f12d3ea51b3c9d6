#include "components/state_estimator/random_updates.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>

#include <Eigen/Eigenvalues>

#include "components/state_estimator/correction.hpp"
#include "components/state_estimator/measurement_models.hpp"
#include "components/state_estimator/process_model.hpp"

namespace adit::state_estimator::test {
namespace {

double least_eigenvalue_ratio(const StateMatrix& p) {
  // Relative to the states' own deviations, so that metres and radians do not hide each other.
  StateVector scale;
  for (int i = 0; i < kStates; ++i) scale(i) = p(i, i) > 0.0 ? 1.0 / std::sqrt(p(i, i)) : 1.0;
  const Eigen::SelfAdjointEigenSolver<StateMatrix> solver(scale.asDiagonal() * p * scale.asDiagonal(),
                                                          Eigen::EigenvaluesOnly);
  return solver.eigenvalues()(0);
}

}  // namespace

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
    Innovation innovation = project(s, l, m);
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

}  // namespace adit::state_estimator::test
