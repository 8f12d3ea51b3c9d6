#include "components/state_estimator/noise_adaptation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "components/state_estimator/test_support.hpp"

namespace adit::state_estimator::test {
namespace {

// Innovations of three rows whose true covariance is (share * truth + 1 - share) times the one they are judged by.
double factor_after(int innovations, double truth, double share, const NoiseAdaptationConfig& config = {}) {
  std::mt19937_64 random(3);
  std::chi_squared_distribution<double> chi2(3.0);
  NoiseAdaptation noise;
  for (int i = 0; i < innovations; ++i) {
    // With the factor f the sensor's share of S is f share / (f share + 1 - share).
    const double s = noise.factor * share + 1.0 - share;
    noise.add(chi2(random) * (truth * share + 1.0 - share) / s, 3, noise.factor * share / s, config);
  }
  return noise.factor;
}

TEST(NoiseAdaptation, FindsTheTrueFactor) {
  for (const double share : {0.4, 1.0}) {
    EXPECT_NEAR(factor_after(2000, 1.0, share), 1.0, 0.5) << share;
    EXPECT_NEAR(std::log(factor_after(2000, 50.0, share) / 50.0), 0.0, 0.5) << share;
  }
  EXPECT_EQ(factor_after(2000, 0.4, 1.0), 1.0);  // never better than reported
}

TEST(NoiseAdaptation, StaysWithinItsBounds) {
  EXPECT_EQ(factor_after(2000, 1e9, 1.0), NoiseAdaptationConfig{}.most);
  EXPECT_EQ(factor_after(2000, 50.0, 0.05), 1.0);  // too small a part of the innovation to be told
  EXPECT_LE(factor_after(15, 1e9, 1.0), NoiseAdaptationConfig{}.largest_step);
}

TEST(NoiseAdaptation, BoundsOfTheMeanOfChiSquares) {
  EXPECT_NEAR(chi_square_bound(45.0, true) * 45.0, 69.957, 0.1);  // 99 % and 1 % quantiles, 45 degrees of freedom
  EXPECT_NEAR(chi_square_bound(45.0, false) * 45.0, 25.901, 0.1);
}

// An odometry that says 1 mm and 0.1 mrad a step and is off by three times that: the filter finds out. Mean over runs
// of the squared error along the way, over its variance.
double normalized_error(bool adaptive) {
  Config config = Config::standard();
  config.adaptation.enabled = adaptive;
  config.initial.speed = 10.0;
  config.odometries.resize(1);
  config.odometries[0].odometry.floor_position = config.odometries[0].odometry.floor_yaw = 1e-6;
  Matrix6d information = Matrix6d::Identity() * 1e6;
  information.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() * 1e8;
  constexpr int runs = 96;  // 400 give 1.55 and 5.4; twelve of them between 0.5 and 3.2
  double sum = 0.0;
  for (int run = 0; run < runs; ++run) {
    Result<std::unique_ptr<StateEstimator>> made = StateEstimator::create(config);
    StateEstimator& e = **made;
    std::mt19937_64 random(static_cast<std::uint64_t>(run));
    std::normal_distribution<double> noise(0.0, 0.003);
    Pose pose = Pose::Identity();
    for (int i = 0; i <= 300; ++i) {
      const std::int64_t t = i * 100 * kMillisecond;
      // One statement a draw: the order in which arguments are evaluated is the compiler's choice.
      const double forward = 1.0 + noise(random);
      const double left = noise(random);
      const double yaw = 0.1 * noise(random);
      if (i > 0) pose = pose * planar(forward, left, yaw);
      OdometrySample sample;
      sample.stamp_ns = t;
      sample.pose = pose;
      sample.information = information;
      e.add_odometry(0, sample, t);
    }
    const double error = e.state().x(kX) - 300.0;
    sum += error * error / e.state().p(kX, kX) / runs;
  }
  return sum;
}

TEST(NoiseAdaptation, AnOverconfidentOdometryIsFoundOut) {
  const double fixed = normalized_error(false), adapted = normalized_error(true);
  EXPECT_LT(adapted, 2.2);  // not 1: until it is found out, the odometry is believed
  EXPECT_GT(fixed, 2.0 * adapted);
}

}  // namespace
}  // namespace adit::state_estimator::test
