// Missing sensors, wrong stamps, numbers that are none, restarts, clocks that are set.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "components/state_estimator/mission.hpp"

namespace adit::state_estimator::test {
namespace {

TEST(StateEstimator, OutagesOfOneBothAndFromTheStart) {
  Mission run(Config::standard());
  run.lidar = [](std::int64_t t) { return t < 20 * kSecond || t > 30 * kSecond; };
  run.thermal = [](std::int64_t t) { return t < 25 * kSecond || t > 40 * kSecond; };
  const auto mode = [&] { return run.estimator->status(run.now).mode; };
  run.until(19 * kSecond);
  EXPECT_EQ(mode(), Mode::fused);
  run.until(22 * kSecond);
  EXPECT_EQ(mode(), Mode::thermal);
  run.until(28 * kSecond);
  EXPECT_EQ(mode(), Mode::dead_reckoning);
  run.until(32 * kSecond);
  EXPECT_EQ(mode(), Mode::lidar);
  run.until(50 * kSecond);
  EXPECT_EQ(mode(), Mode::fused);
  EXPECT_EQ(run.silent, 0);
  EXPECT_LT(run.largest_jump, 0.05);
  EXPECT_LT(run.error(), 1.5);

  Mission nothing(Config::standard());
  nothing.lidar = nothing.thermal = [](std::int64_t) { return false; };
  nothing.until(20 * kSecond);
  EXPECT_EQ(nothing.silent, 0);
  EXPECT_EQ(nothing.estimator->status(nothing.now).mode, Mode::dead_reckoning);
  Mission lonely(Config::standard());
  lonely.lidar = [](std::int64_t) { return false; };
  lonely.until(20 * kSecond);
  EXPECT_EQ(lonely.estimator->status(lonely.now).mode, Mode::thermal);
  EXPECT_EQ(lonely.silent, 0);
}

TEST(StateEstimator, BadInputIsCountedAndHarmless) {
  Mission run(Config::standard());
  run.until(10 * kSecond);
  StateEstimator& e = *run.estimator;
  const std::int64_t now = run.now;
  const FilterState before = e.state();
  Pose nan = Pose::Identity();
  nan.translation().x() = std::nan("");
  EXPECT_EQ(e.add_odometry(0, sample(now, nan), now), Verdict::malformed);
  EXPECT_EQ(e.add_odometry(0, sample(now + 10 * kSecond, Pose::Identity()), now), Verdict::from_the_future);
  EXPECT_EQ(e.add_odometry(7, sample(now, Pose::Identity()), now), Verdict::unknown_sensor);
  EXPECT_EQ(e.add_odometry(-1, sample(now, Pose::Identity()), now), Verdict::unknown_sensor);
  EXPECT_EQ(e.add_imu({}, now), Verdict::unknown_sensor);  // none configured
  EXPECT_EQ(e.add_gnss({}, now), Verdict::unknown_sensor);
  RelativeMotion old;
  old.from_ns = now - 9 * kSecond;
  old.to_ns = old.from_ns + 100 * kMillisecond;
  EXPECT_EQ(e.add_motion(0, old, now), Verdict::too_old);
  RelativeMotion bad = old;
  bad.from_ns = now - kSecond;
  bad.to_ns = bad.from_ns + 100 * kMillisecond;
  bad.information = Matrix6d::Constant(std::numeric_limits<double>::infinity());
  EXPECT_EQ(e.add_motion(0, bad, now), Verdict::malformed);
  EXPECT_EQ((e.state().x - before.x).norm(), 0.0);
  OdometrySample twice = sample(now - 50 * kMillisecond, on_circle(now - 50 * kMillisecond));
  EXPECT_EQ(e.add_odometry(0, twice, now), Verdict::duplicate);
  const SensorReport r = e.status(now).sensors[0];
  EXPECT_EQ(r.malformed, 2u);
  EXPECT_EQ(r.future, 1u);
  EXPECT_EQ(r.too_old, 1u);
  EXPECT_EQ(r.duplicates, 1u);
  // Any information matrix that is finite is survived: none, absurdly large, indefinite.
  for (const double strength : {0.0, 1e300, 1e-300, -1e6}) {
    OdometrySample s = sample(run.now + 50 * kMillisecond, on_circle(run.now + 50 * kMillisecond));
    s.information = strength * Matrix6d::Identity();
    run.now += 100 * kMillisecond;
    e.add_odometry(0, s, run.now);
    EXPECT_TRUE(e.state().x.allFinite());
    EXPECT_TRUE(e.state().p.allFinite());
  }
  run.until(20 * kSecond);
  EXPECT_LT(run.error(), 1.0);
  EXPECT_EQ(run.silent, 0);
}

TEST(StateEstimator, ARestartedOdometryDoesNotMoveTheRobot) {
  Config config = Config::standard();
  Mission run(config);
  run.until(10 * kSecond);
  StateEstimator& e = *run.estimator;
  // Without a word: the pose jumps by 100 m.
  const Pose offset = planar(100.0, -30.0, 2.0);
  std::int64_t t = run.now + 50 * kMillisecond;
  EXPECT_EQ(e.add_odometry(0, sample(t, offset * on_circle(t)), t), Verdict::jump);
  // With a new frame.
  OdometrySample fresh = sample(t + 100 * kMillisecond, on_circle(0));
  fresh.frame = 1;
  EXPECT_EQ(e.add_odometry(0, fresh, t + 100 * kMillisecond), Verdict::first);
  fresh.stamp_ns += 100 * kMillisecond;
  fresh.pose = on_circle(100 * kMillisecond);
  EXPECT_EQ(e.add_odometry(0, fresh, t + 200 * kMillisecond), Verdict::fused);
  const Estimate estimate = *e.estimate(t + 150 * kMillisecond);
  EXPECT_LT((estimate.pose.translation() - on_circle(t + 150 * kMillisecond).translation()).norm(), 0.5);
  // A pause longer than max_interval_s is a gap, not a motion.
  fresh.stamp_ns += 2 * kSecond;
  EXPECT_EQ(e.add_odometry(0, fresh, fresh.stamp_ns), Verdict::gap);
  EXPECT_EQ(e.status(fresh.stamp_ns).sensors[0].gaps, 1u);
}

TEST(StateEstimator, ClockSetBackKeepsThePoseAndGoesOn) {
  Mission run(Config::standard());
  run.until(60 * kSecond);
  const Pose before = run.estimator->estimate(run.now)->pose;
  // The bag starts over: same stamps again.
  run.now = 30 * kSecond;
  ASSERT_TRUE(run.estimator->publish(run.now));
  EXPECT_LT((run.estimator->estimate(run.now)->pose.translation() - before.translation()).norm(), 1e-9);
  const Status jumped = run.estimator->status(run.now);
  EXPECT_EQ(jumped.clock_jumps, 1u);
  run.until(40 * kSecond);
  EXPECT_EQ(run.silent, 0);
  const Status status = run.estimator->status(run.now);
  EXPECT_EQ(status.clock_jumps, 1u);
  EXPECT_EQ(status.mode, Mode::fused);
  EXPECT_NEAR(run.estimator->estimate(run.now)->speed, 2.0, 0.1);
}

TEST(StateEstimator, ClockSetForwardForgetsTheMotionNotThePose) {
  Mission run(Config::standard());
  run.until(10 * kSecond);
  run.now += 1'000'000 * kSecond;
  run.estimator->publish(run.now);
  run.now -= run.now % (200 * kMillisecond);
  for (int i = 0; i < 20; ++i) {
    run.now += 100 * kMillisecond;
    run.estimator->add_odometry(0, sample(run.now, on_circle(i * 100 * kMillisecond)), run.now);
  }
  EXPECT_EQ(run.estimator->status(run.now).forgotten_motions, 1u);
  EXPECT_TRUE(run.estimator->state().p.allFinite());
  EXPECT_NEAR(run.estimator->estimate(run.now)->speed, 2.0, 0.1);
}

}  // namespace
}  // namespace adit::state_estimator::test
