#include "components/state_estimator/imu_input.hpp"

#include <gtest/gtest.h>

#include <random>

#include "components/geometry/se3.hpp"

namespace adit::state_estimator {
namespace {

constexpr std::int64_t kStep = 5'000'000;  // 200 Hz
const Eigen::Vector3d kGravity(0.0, 0.0, 9.81);

TEST(Tilt, FollowsRollAndPitchThroughATurn) {
  // Body on a 5 degree slope, turning: the levelled yaw rate is the turn, the levelled force has no gravity ahead.
  const Eigen::Matrix3d slope = so3_exp({0.0, 0.0873, 0.0});
  Tilt tilt;
  EXPECT_FALSE(tilt.ready());
  Eigen::Matrix3d rotation = slope;
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();
  for (int i = 0; i < 4000; ++i) {
    gyro = rotation.transpose() * Eigen::Vector3d(0.0, 0.0, 0.4);
    tilt.update(i * kStep, gyro, rotation.transpose() * kGravity, 0.0, 0.0);
    rotation = so3_exp({0.0, 0.0, 0.4 * 0.005}) * rotation;
  }
  const Eigen::Matrix3d level = tilt.level();
  EXPECT_LT((level * level.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-9);
  EXPECT_NEAR(level.row(2).dot(gyro), 0.4, 1e-3);
  EXPECT_NEAR(level.row(0).dot(rotation.transpose() * kGravity), 0.0, 0.05);
  EXPECT_NEAR(yaw(level), 0.0, 1e-9);
}

TEST(Tilt, AccelerationIsNotMistakenForASlope) {
  Tilt told, untold;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d force = kGravity + Eigen::Vector3d(i > 200 ? 1.0 : 0.0, 0.0, 0.0);
    told.update(i * kStep, Eigen::Vector3d::Zero(), force, i > 200 ? 1.0 : 0.0, 0.0);
    untold.update(i * kStep, Eigen::Vector3d::Zero(), force, 0.0, 0.0);
  }
  EXPECT_NEAR(told.level().row(0).dot(kGravity), 0.0, 1e-6);
  EXPECT_GT(std::abs(untold.level().row(0).dot(kGravity)), 0.5);
}

TEST(Tilt, FreeFallShocksAndGapsDoNoHarm) {
  Tilt tilt;
  tilt.update(0, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), 0.0, 0.0);
  EXPECT_FALSE(tilt.ready());
  tilt.update(kStep, Eigen::Vector3d::Zero(), kGravity, 0.0, 0.0);
  EXPECT_TRUE(tilt.ready());
  tilt.update(2 * kStep, Eigen::Vector3d::Zero(), Eigen::Vector3d(100.0, 0.0, 0.0), 0.0, 0.0);
  tilt.update(kStep, Eigen::Vector3d(5.0, 5.0, 5.0), kGravity, 0.0, 0.0);  // back in time
  EXPECT_LT((tilt.level() - Eigen::Matrix3d::Identity()).norm(), 1e-9);
  tilt.update(5'000'000'000, Eigen::Vector3d::Zero(), so3_exp({0.0, 0.1, 0.0}).transpose() * kGravity, 0.0, 0.0);
  EXPECT_LT((tilt.level() - so3_exp({0.0, 0.1, 0.0})).norm(), 1e-9);
}

TEST(OdomTilt, RollAndPitchGoOnInOdomWhateverTheHeading) {
  // odom is tilted against gravity; the body turns in it and rolls.
  const Eigen::Matrix3d gravity_from_odom = so3_exp({0.03, -0.05, 0.0});
  const auto by_gravity = [&](double heading, const Eigen::Matrix3d& in_odom) {
    const Eigen::Matrix3d turn = so3_exp({0.0, 0.0, heading});
    return Eigen::Matrix3d(turn.transpose() * gravity_from_odom * turn * in_odom);
  };
  OdomTilt tilt;
  EXPECT_FALSE(tilt.ready());
  for (int i = 0; i < 100; ++i) {
    const Eigen::Matrix3d rolled = so3_exp({0.01 * std::sin(0.3 * i), 0.0, 0.0});
    tilt.observe(0.02 * i, rolled, by_gravity(0.02 * i, rolled));
  }
  EXPECT_TRUE(tilt.ready());
  const Eigen::Matrix3d pitched = so3_exp({0.0, 0.04, 0.0});
  EXPECT_LT((tilt.in_odom(-1.5, by_gravity(-1.5, pitched)) - pitched).norm(), 1e-3);
}

class Standstill : public testing::Test {
 protected:
  void feed(double duration, double gyro_sigma, double force_sigma, const Eigen::Vector3d& turn) {
    for (double t = 0.0; t < duration; t += 0.005) {
      stamp_ += kStep;
      const Eigen::Vector3d g(normal_(random_), normal_(random_), normal_(random_));
      const Eigen::Vector3d a(normal_(random_), normal_(random_), normal_(random_));
      detector_.update(stamp_, turn + gyro_sigma * g, kGravity + force_sigma * a);
    }
  }
  StandstillDetector detector_;
  std::int64_t stamp_ = 0;
  std::mt19937_64 random_{6};
  std::normal_distribution<double> normal_;
};

TEST_F(Standstill, QuietIsStandingVibrationIsNot) {
  feed(0.1, 0.003, 0.03, Eigen::Vector3d::Zero());
  EXPECT_FALSE(detector_.stands());  // too early to tell
  feed(5.0, 0.003, 0.03, Eigen::Vector3d::Zero());
  EXPECT_TRUE(detector_.stands());
  feed(0.5, 0.05, 1.0, Eigen::Vector3d::Zero());
  EXPECT_FALSE(detector_.stands());
  feed(5.0, 0.003, 0.03, Eigen::Vector3d(0.0, 0.0, 0.3));
  EXPECT_FALSE(detector_.stands());  // a smooth turn
}

}  // namespace
}  // namespace adit::state_estimator
