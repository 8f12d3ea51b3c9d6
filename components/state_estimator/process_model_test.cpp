#include "components/state_estimator/process_model.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include <Eigen/Eigenvalues>

#include "components/state_estimator/test_support.hpp"

namespace adit::state_estimator {
namespace {

CoreVector fast() {
  CoreVector x;
  x << 3.0, -2.0, 13.9, 1.2, 2.1, 0.3, -0.4;
  return x;
}

CoreVector difference(const CoreVector& a, const CoreVector& b) {
  CoreVector d = a - b;
  d(kYaw) = wrap_angle(d(kYaw));
  return d;
}

TEST(ProcessModel, JacobianEqualsCentralDifferences) {
  for (const double tau : {0.0, 1.0}) {
    for (const double step : {0.005, 0.05, 0.2}) {
      const CoreMatrix g = transition_jacobian(fast(), step, tau);
      for (int i = 0; i < kCoreStates; ++i) {
        CoreVector plus = fast(), minus = fast();
        plus(i) += 1e-5;
        minus(i) -= 1e-5;
        const CoreVector numeric = difference(transition(plus, step, tau), transition(minus, step, tau)) / 2e-5;
        EXPECT_LT((numeric - g.col(i)).norm(), 1e-6 * (1.0 + g.col(i).norm())) << i << " " << step << " " << tau;
      }
    }
  }
}

TEST(ProcessModel, ATurnedAndShiftedStartGivesTheTurnedAndShiftedEnd) {
  const double angle = 0.83;
  const Eigen::Rotation2Dd turn(angle);
  const Eigen::Vector2d shift(5.0, 7.0);
  const auto moved = [&](CoreVector x) {
    x.head<2>() = turn * x.head<2>() + shift;
    x(kYaw) = wrap_angle(x(kYaw) + angle);
    return x;
  };
  EXPECT_LT(difference(transition(moved(fast()), 0.05), moved(transition(fast(), 0.05))).norm(), 1e-12);
}

TEST(ProcessModel, ConstantTurnIsACircularArc) {
  CoreVector x = CoreVector::Zero();
  x(kSpeed) = 10.0;
  x(kYawRate) = 0.3;
  const double t = 0.05;
  const CoreVector end = transition(x, t);
  EXPECT_NEAR(end(kX), 10.0 / 0.3 * std::sin(0.3 * t), 1e-6);
  EXPECT_NEAR(end(kY), 10.0 / 0.3 * (1.0 - std::cos(0.3 * t)), 1e-6);
  // v = 27.8 m/s, omega = 0.3, alpha = 0.2: the specification computed 1.6 um for T = 0.05 s.
  x << 0, 0, 27.8, 0, 0, 0.3, 0.2;
  CoreVector fine = x;
  for (int i = 0; i < 1000; ++i) fine = transition(fine, t / 1000);
  EXPECT_NEAR((transition(x, t) - fine).head<2>().norm(), 1.6e-6, 0.3e-6);
}

TEST(ProcessModel, TwoStepsAreOneUpToFourthOrder) {
  const auto gap = [](double t) {
    return (transition(transition(fast(), t), t) - transition(fast(), 2 * t)).head<2>().norm();
  };
  EXPECT_NEAR(std::log2(gap(0.04) / gap(0.02)), 4.0, 0.3);
}

TEST(ProcessModel, DecayBringsTheAccelerationToRest) {
  CoreVector x = CoreVector::Zero();
  x(kSpeed) = 10.0;
  x(kAccel) = 0.3;
  for (int i = 0; i < 600; ++i) x = transition(x, 0.05, 1.0);
  EXPECT_NEAR(x(kAccel), 0.0, 1e-9);
  EXPECT_NEAR(x(kSpeed), 10.3, 1e-6);                    // 0.3 m/s^2 for one time constant
  EXPECT_NEAR(x(kX), 300.0 + 0.3 * (30.0 - 1.0), 1e-3);  // not the 135 m of constant acceleration
}

TEST(ProcessModel, NoiseOfTenStepsIsTheNoiseOfOne) {
  ProcessNoise noise;
  noise.accel = 0.3;
  noise.yaw_accel = 0.02;
  noise.yaw = 1e-4;
  noise.position = 1e-3;
  CoreVector x = fast();
  x(kAccel) = x(kYawRate) = x(kYawAccel) = 0.0;  // straight: the expressions are exact there
  const CoreMatrix once = process_noise(x, 0.1, noise);
  CoreMatrix ten = CoreMatrix::Zero();
  for (int i = 0; i < 10; ++i) {
    const CoreMatrix g = transition_jacobian(x, 0.01);
    ten = g * ten * g.transpose() + process_noise(x, 0.01, noise);
    x = transition(x, 0.01);
  }
  const Eigen::Matrix<double, kCoreStates, 1> scale = once.diagonal().cwiseSqrt().cwiseInverse();
  EXPECT_LT((scale.asDiagonal() * (ten - once) * scale.asDiagonal()).cwiseAbs().maxCoeff(), 1e-3);
  EXPECT_LT((once - once.transpose()).norm(), 1e-15);
  const Eigen::SelfAdjointEigenSolver<CoreMatrix> solver(scale.asDiagonal() * once * scale.asDiagonal());
  EXPECT_GT(solver.eigenvalues()(0), -1e-12);
}

TEST(ProcessModel, NoiseMatchesAMonteCarloOfItsDefinition) {
  // A thousand drives of one second from the same start: the sample covariance is what process_noise promises.
  ProcessNoise noise;
  noise.jerk = 1.0;
  noise.yaw_jerk = 0.05;
  CoreVector start = CoreVector::Zero();
  start(kSpeed) = 5.0;
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  CoreMatrix sum = CoreMatrix::Zero();
  constexpr int runs = 4000;
  for (int r = 0; r < runs; ++r) {
    CoreVector x = start;
    for (int i = 0; i < 100; ++i) {
      x = transition(x, 0.005);
      x(kAccel) += std::sqrt(noise.jerk * 0.005) * normal(random);
      x(kYawAccel) += std::sqrt(noise.yaw_jerk * 0.005) * normal(random);
    }
    CoreVector expected = transition(start, 0.5);
    const CoreVector d = difference(x, expected);
    sum += d * d.transpose() / runs;
  }
  const CoreMatrix q = process_noise(start, 0.5, noise);
  for (int i = 0; i < kCoreStates; ++i) EXPECT_NEAR(sum(i, i) / q(i, i), 1.0, 0.1) << i;
  EXPECT_NEAR(sum(kY, kYaw) / q(kY, kYaw), 1.0, 0.15);
  EXPECT_NEAR(sum(kX, kSpeed) / q(kX, kSpeed), 1.0, 0.15);
}

FilterState started() {
  FilterState s;
  s.stamp_ns = 0;
  s.x(kSpeed) = 2.0;
  s.p.topLeftCorner<kCoreStates, kCoreStates>().setIdentity();
  return s;
}

TEST(Predict, SubStepsDoNotMatterAndTheStampIsExact) {
  ProcessConfig config;
  FilterState a = started(), b = started();
  predict(a, 1'000'000'007, config);
  for (std::int64_t t = 1; t <= 100; ++t) predict(b, 10'000'000 * t, config);
  predict(b, 1'000'000'007, config);
  EXPECT_EQ(a.stamp_ns, 1'000'000'007);
  EXPECT_LT((a.x - b.x).norm(), 1e-9);
  EXPECT_LT((a.p - b.p).norm(), 1e-3 * a.p.norm());
  const StateVector before = a.x;
  predict(a, 5, config);  // never back
  EXPECT_EQ(a.stamp_ns, 1'000'000'007);
  EXPECT_EQ((a.x - before).norm(), 0.0);
}

TEST(Predict, OutageDecaysSoftLimitsHoldAndNothingHangs) {
  ProcessConfig config;
  FilterState s = started();
  s.last_motion_ns = 0;
  s.x(kAccel) = 1.0;
  s.x(kSpeed) = 10.0;
  predict(s, 30'000'000'000, config);
  EXPECT_NEAR(s.x(kSpeed), 10.0 + 0.7 + 1.0, 1e-3);
  EXPECT_TRUE(s.p.allFinite());
  FilterState wild = started();
  wild.x(kAccel) = 1e6;
  predict(wild, 1'000'000'000, config);
  EXPECT_LT(std::abs(wild.x(kSpeed)), 1e6);
  EXPECT_TRUE(wild.x.allFinite());
  FilterState year = started();
  year.last_motion_ns = 0;
  predict(year, 30'000'000'000'000'000, config);
  EXPECT_TRUE(year.x.allFinite());
  EXPECT_TRUE(year.p.allFinite());
}

TEST(Predict, SwitchedOffCalibrationStaysOff) {
  ProcessConfig config;
  FilterState s = started();
  s.p(kScale, kScale) = 0.01;
  predict(s, 1'000'000'000, config);
  EXPECT_NEAR(s.p(kScale, kScale), 0.01 + config.noise.scale, 1e-15);
  EXPECT_EQ(s.p(kGyroBias, kGyroBias), 0.0);
}

TEST(FilterState, CloneCarriesAllCorrelations) {
  FilterState s = started();
  StateMatrix a = StateMatrix::Random();
  s.p = a * a.transpose();
  s.x = StateVector::Random();
  s.clone(1);
  const int c = clone_index(1);
  const int pose[3] = {kX, kY, kYaw};
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(s.x(c + i), s.x(pose[i]));
    for (int j = 0; j < 3; ++j) EXPECT_EQ(s.p(c + i, c + j), s.p(pose[i], pose[j]));
    EXPECT_EQ(s.p(c + i, kScale), s.p(pose[i], kScale));
    EXPECT_EQ(s.p(kSpeed, c + i), s.p(kSpeed, pose[i]));
  }
  EXPECT_LT((s.p - s.p.transpose()).norm(), 1e-12);
  s.drop_clone(1);
  EXPECT_EQ(s.p.row(c).norm(), 0.0);
}

}  // namespace
}  // namespace adit::state_estimator
