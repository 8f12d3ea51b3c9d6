#include "components/state_estimator/health.hpp"

#include <gtest/gtest.h>

#include "components/state_estimator/filter.hpp"
#include "components/state_estimator/measurement_models.hpp"
#include "components/state_estimator/test_support.hpp"

namespace adit::state_estimator {
namespace {

using test::kMillisecond;
using test::kSecond;

constexpr double kLidarSigma = 0.05, kThermalSigma = 0.2;

// Sensor 0 at 10 Hz and sensor 1 at 30 Hz report (v, psi'); the truth moves at 5 m/s.
class TwoSensors : public testing::Test {
 protected:
  TwoSensors() {
    for (int i = 0; i < 2; ++i) {
      SensorModel m;
      m.model = std::make_unique<SpeedAndYawRate>();
      m.moves = true;
      filter_.add_sensor(std::move(m));
    }
    state_.stamp_ns = 0;
    state_.x(kSpeed) = 5.0;
    state_.p.diagonal().head<kCoreStates>() << 1e-4, 1e-4, 0.25, 1.0, 1e-5, 0.04, 0.25;
  }
  void lidar(double speed, double suspicion = 0.0) {
    Measurement m = test::rates(0, now_, speed + kLidarSigma * normal_(random_), 0.0, kLidarSigma, 0.002);
    m.motion.suspicion = suspicion;
    filter_.apply(state_, m);
  }
  void thermal(double speed, double suspicion = 0.0) {
    Measurement m = test::rates(1, now_, speed + kThermalSigma * normal_(random_), 0.0, kThermalSigma, 0.004);
    m.motion.suspicion = suspicion;
    filter_.apply(state_, m);
  }
  template <class Lidar, class Thermal>
  void run(double duration, Lidar lidar_speed, Thermal thermal_speed, double suspicion = 0.0) {
    const std::int64_t start = now_;
    for (int i = 1; seconds_between(start, now_) < duration; ++i) {
      now_ += 33 * kMillisecond;
      const double t = seconds_between(start, now_);
      thermal(thermal_speed(t));
      if (i % 3 == 0) lidar(lidar_speed(t), suspicion);
    }
  }

  Filter filter_;
  FilterState state_;
  std::int64_t now_ = 0;
  std::mt19937_64 random_{4};
  std::normal_distribution<double> normal_;
};

// A sensor with a scale, beside it one that measures true lengths: the scale is known before it drifts.
TEST(FrontEndScale, DriftsByItsOwnAccountAndStartsAnewWhenMeasuredAnew) {
  Filter filter;
  filter.scale_sigma = 0.01;
  SensorModel model;
  model.model = std::make_unique<SpeedAndYawRate>(OdometryCalibration{.scale = true, .yaw_bias = false});
  model.moves = model.scaled = true;
  filter.add_sensor(std::move(model));
  FilterState state;
  state.stamp_ns = 0;
  state.x(kSpeed) = 5.0;
  state.x(kScale) = 0.02;
  state.p.diagonal().head<kCoreStates>().setConstant(1e-6);
  state.p(kScale, kScale) = 1e-6;
  filter.process.noise.scale = 0.0;
  const auto say = [&](double log_scale_sigma) {
    Measurement m = test::rates(0, state.stamp_ns + kMillisecond, 5.0, 0.0, 0.1, 0.01);
    m.rows = 0;  // nothing but its account
    m.log_scale_sigma = log_scale_sigma;
    filter.apply(state, m);
  };
  say(0.004);
  say(0.004);
  EXPECT_DOUBLE_EQ(state.p(kScale, kScale), 1e-6);
  say(0.010);
  say(0.020);
  EXPECT_NEAR(state.p(kScale, kScale), 1e-6 + 0.020 * 0.020 - 0.004 * 0.004, 1e-12);
  EXPECT_DOUBLE_EQ(state.x(kScale), 0.02);
  state.p(kScale, kX) = state.p(kX, kScale) = 1e-7;
  say(0.004);
  EXPECT_DOUBLE_EQ(state.x(kScale), 0.0);
  EXPECT_DOUBLE_EQ(state.p(kScale, kScale), 1e-4);
  EXPECT_DOUBLE_EQ(state.p(kScale, kX), 0.0);
  EXPECT_DOUBLE_EQ(state.p(kX, kScale), 0.0);
}

const auto kFive = [](double) { return 5.0; };
const auto kZero = [](double) { return 0.0; };

TEST_F(TwoSensors, AgreeingSensorsAreBothUsed) {
  run(60.0, kFive, kFive);
  EXPECT_FALSE(state_.conflict);
  EXPECT_EQ(state_.sensors[0].distrusted + state_.sensors[1].distrusted, 0u);
  EXPECT_NEAR(state_.x(kSpeed), 5.0, 0.15);
  // 0.1 % of honest measurements fail a 99.9 % gate.
  EXPECT_LT(state_.sensors[1].rejected, 12u);
}

TEST_F(TwoSensors, ZeroMotionAttractorIsDistrusted) {
  run(5.0, kFive, kFive);
  run(10.0, kZero, kFive);
  EXPECT_TRUE(state_.sensors[0].is_distrusted);
  EXPECT_FALSE(state_.sensors[1].is_distrusted);
  EXPECT_NEAR(state_.x(kSpeed), 5.0, 0.4);
  EXPECT_EQ(state_.sensors[0].forced, 0u);
  run(3.0, kFive, kFive);  // out of the smoke: agreement brings it back
  EXPECT_FALSE(state_.sensors[0].is_distrusted);
  EXPECT_FALSE(state_.conflict);
}

TEST_F(TwoSensors, SlowClutterLockIsCaughtToo) {
  run(5.0, kFive, kFive);
  // Within 4 s the LiDAR's speed fades to nothing: slow enough to pass the gate in between.
  run(
      12.0, [](double t) { return std::max(0.0, 5.0 * (1.0 - t / 4.0)); }, kFive);
  EXPECT_TRUE(state_.sensors[0].is_distrusted);
  EXPECT_NEAR(state_.x(kSpeed), 5.0, 0.5);
}

TEST_F(TwoSensors, FrontEndsDoubtDecides) {
  run(5.0, kFive, kFive);
  run(
      5.0, [](double) { return 4.0; }, kFive, 0.9);
  EXPECT_TRUE(state_.sensors[0].is_distrusted);
  EXPECT_NEAR(state_.x(kSpeed), 5.0, 0.3);
}

TEST_F(TwoSensors, WithoutEvidenceBothAreWidened) {
  filter_.gate.enabled = false;  // no gate history as evidence: a pure draw
  run(5.0, kFive, kFive);
  const double before = state_.p(kSpeed, kSpeed);
  run(
      5.0, [](double) { return 4.0; }, [](double) { return 6.0; });
  EXPECT_TRUE(state_.conflict);
  EXPECT_GT(state_.p(kSpeed, kSpeed), 10.0 * before);
  EXPECT_FALSE(state_.sensors[0].is_distrusted || state_.sensors[1].is_distrusted);
}

TEST_F(TwoSensors, ARealStopIsNoConflict) {
  run(5.0, kFive, kFive);
  const auto brake = [](double t) { return std::max(0.0, 5.0 - 3.0 * t); };
  run(5.0, brake, brake);
  EXPECT_FALSE(state_.conflict);
  EXPECT_FALSE(state_.sensors[0].is_distrusted || state_.sensors[1].is_distrusted);
  EXPECT_NEAR(state_.x(kSpeed), 0.0, 0.15);
}

TEST_F(TwoSensors, LockOutGuardLetsALonelySensorIn) {
  // The filter is wrong (a bad start), the only sensor is right.
  state_.x(kSpeed) = -20.0;
  state_.p(kSpeed, kSpeed) = 0.01;
  for (int i = 0; i < 60; ++i) {
    now_ += 100 * kMillisecond;
    lidar(5.0);
  }
  EXPECT_EQ(state_.sensors[0].forced, 1u);
  EXPECT_NEAR(state_.x(kSpeed), 5.0, 0.2);
}

TEST_F(TwoSensors, FrozenFrameIsNotAStop) {
  run(5.0, kFive, kFive);
  for (int i = 0; i < 20; ++i) {
    now_ += 33 * kMillisecond;
    Measurement m = test::rates(1, now_, 0.0, 0.0, kThermalSigma, 0.004);
    m.motion.frozen = true;
    filter_.apply(state_, m);
  }
  EXPECT_EQ(state_.sensors[1].distrusted, 20u);
  EXPECT_NEAR(state_.x(kSpeed), 5.0, 0.5);
}

TEST(Health, MajorityOfThree) {
  FilterState s;
  DisagreementConfig config;
  for (int step = 0; step < 20; ++step) {
    const std::int64_t t = step * 100 * kMillisecond;
    for (int i = 0; i < 3; ++i) {
      const Motion motion = test::rates(i, t, i == 1 ? 7.0 : 5.0, 0.0, 0.1, 0.01).motion;
      observe_motion(s, i, t, motion, 1.0, config);
    }
    judge(s, t, false, config);
  }
  EXPECT_TRUE(s.sensors[1].is_distrusted);
  EXPECT_FALSE(s.sensors[0].is_distrusted || s.sensors[2].is_distrusted || s.conflict);
}

TEST(Health, DegenerateSpeedIsNotCompared) {
  FilterState s;
  DisagreementConfig config;
  for (int step = 0; step < 20; ++step) {
    const std::int64_t t = step * 100 * kMillisecond;
    Motion lost = test::rates(0, t, 0.0, 0.1, 0.1, 0.01).motion;
    lost.has_speed = false;
    observe_motion(s, 0, t, lost, 1.0, config);
    observe_motion(s, 1, t, test::rates(1, t, 5.0, 0.1, 0.1, 0.01).motion, 1.0, config);
    judge(s, t, false, config);
  }
  EXPECT_FALSE(s.conflict || s.sensors[0].is_distrusted || s.sensors[1].is_distrusted);
}

TEST(Health, AStillImuMakesTheMovingSensorTheSuspect) {
  FilterState s;
  DisagreementConfig config;
  for (int step = 0; step < 20; ++step) {
    const std::int64_t t = step * 100 * kMillisecond;
    observe_motion(s, 0, t, test::rates(0, t, 0.0, 0.0, 0.05, 0.01).motion, 1.0, config);
    observe_motion(s, 1, t, test::rates(1, t, 2.0, 0.0, 0.1, 0.01).motion, 1.0, config);
    judge(s, t, true, config);
  }
  EXPECT_TRUE(s.sensors[1].is_distrusted);
  EXPECT_FALSE(s.sensors[0].is_distrusted);
  // The other one gone, it gets its chance again after a while.
  for (int step = 20; step < 100; ++step) {
    const std::int64_t t = step * 100 * kMillisecond;
    observe_motion(s, 1, t, test::rates(1, t, 2.0, 0.0, 0.1, 0.01).motion, 1.0, config);
    judge(s, t, false, config);
  }
  EXPECT_FALSE(s.sensors[1].is_distrusted);
}

// Neither front end doubts itself: the one that departs from the motion both had seen before is not believed, be it the
// more precise one or the other.
TEST_F(TwoSensors, TheOneThatDepartsFromTheMotionSoFarIsDistrusted) {
  run(3.0, kFive, kFive);
  run(1.5, kFive, [](double) { return 9.0; });
  EXPECT_TRUE(state_.sensors[1].is_distrusted);
  EXPECT_FALSE(state_.sensors[0].is_distrusted);
  EXPECT_NEAR(state_.x(kSpeed), 5.0, 0.3);
  run(5.0, kFive, kFive);
  EXPECT_FALSE(state_.sensors[1].is_distrusted);
  run(
      1.5, [](double) { return 9.0; }, kFive);
  EXPECT_TRUE(state_.sensors[0].is_distrusted);
  EXPECT_NEAR(state_.x(kSpeed), 5.0, 0.5);
}

}  // namespace
}  // namespace adit::state_estimator
