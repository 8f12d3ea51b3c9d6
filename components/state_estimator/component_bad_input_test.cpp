// What may be wrong with what the component is given: it goes on, finite and without a gap, and says so.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "components/runtime/registry.hpp"
#include "components/runtime/stamp.hpp"
#include "components/runtime/testing/harness.hpp"
#include "components/state_estimator/component_drive.hpp"

namespace adit::state_estimator::test {
namespace {

using adit::testing::into;

TEST(StateEstimatorComponent, OneSensorMissingFromTheStartIsStated) {
  const Outcome without_lidar = run({.lidar = false}), without_thermal = run({.thermal = false});
  for (const Outcome* out : {&without_lidar, &without_thermal}) {
    expect_continuous(*out, 999);
  }
  EXPECT_LT(error(without_thermal), 0.05);
  EXPECT_LT(error(without_lidar), 1.0);  // its scale is only known to 10 %
  EXPECT_EQ(without_lidar.status.back().mode, FusionStatus::MODE_THERMAL);
  EXPECT_EQ(without_lidar.sensor("lidar").health, SensorStatus::ABSENT);
  EXPECT_EQ(without_lidar.sensor("lidar").reason, "no data");
  EXPECT_LT(without_lidar.sensor("lidar").age, 0.0);
  EXPECT_EQ(without_lidar.sensor("thermal").health, SensorStatus::HEALTHY);
  EXPECT_EQ(without_thermal.status.back().mode, FusionStatus::MODE_LIDAR);
  EXPECT_EQ(without_thermal.sensor("thermal").health, SensorStatus::ABSENT);
}

TEST(StateEstimatorComponent, WithoutAnySensorItWaitsAtTheStart) {
  const Outcome out = run({.lidar = false, .thermal = false});
  expect_continuous(out, 999);
  EXPECT_EQ(out.status.back().mode, FusionStatus::MODE_INITIALIZING);
  EXPECT_LT(out.end().norm(), 1e-6);
  EXPECT_GT(out.poses.back().pose.covariance[0], out.poses.front().pose.covariance[0]);
}

TEST(StateEstimatorComponent, AnOutageOfBothIsBridgedAndGrowsTheCovariance) {
  const auto stop = [](Odometry& message, Duration& arrival, int) {
    if (arrival > begin + 8s) message.pose.pose.orientation.w = std::nan("");
  };
  const Outcome out = run({.change_lidar = stop, .change_thermal = stop});
  expect_continuous(out, 999);
  EXPECT_EQ(out.status.back().mode, FusionStatus::MODE_DEAD_RECKONING);
  EXPECT_EQ(out.sensor("lidar").health, SensorStatus::DEGRADED);
  EXPECT_GT(out.sensor("lidar").dropped, 10u);
  EXPECT_LT(error(out), 3.0);
  EXPECT_GT(out.poses.back().pose.covariance[0], 10.0 * out.poses[790].pose.covariance[0]);
}

TEST(StateEstimatorComponent, SurvivesBadMessages) {
  const double infinity = std::numeric_limits<double>::infinity(), nan = std::nan("");
  SyntheticDrive drive;
  drive.change_lidar = [&](Odometry& message, Duration& arrival, int i) {
    switch (i % 12) {
      case 1:
        set_covariance(message, {nan, nan, nan, nan, nan, nan});
        break;
      case 2:
        set_covariance(message, {1e300, 1e300, 1e300, 1e300, 1e300, 1e300});
        break;
      case 3:
        set_covariance(message, {-1.0, 1.0, 1.0, 1.0, 1.0, 1.0});
        break;
      case 4:
        set_covariance(message, {infinity, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6});
        break;
      case 5:
        message.pose.pose.position.x = nan;
        break;
      case 6:
        message.pose.pose.orientation = {0.0, 0.0, 0.0, 0.0};
        break;
      case 7:
        message.header.stamp = to_stamp(Time(arrival + 1000s));
        break;
      case 8:
        message.header.stamp = to_stamp(Time(0s));
        break;
      case 9:
        message.pose.pose.position.y = infinity;
        break;
      case 10:
        set_covariance(message, {1e-30, 1e-30, 1e-30, 1e-30, 1e-30, 1e-30});
        break;
      default:
        break;
    }
  };
  const Outcome out = run(drive);
  expect_continuous(out, 999);
  EXPECT_LT(error(out), 0.3);
  EXPECT_GE(out.sensor("lidar").dropped, 30u);
  EXPECT_EQ(out.sensor("thermal").health, SensorStatus::HEALTHY);
}

TEST(StateEstimatorComponent, ARestartedOdometryGoesOnFromWhereTheBodyIs) {
  SyntheticDrive drive;
  drive.change_lidar = [](Odometry& message, Duration&, int i) {
    if (i < 50) return;
    const double t = 0.1 * i;
    message = odometry(to_time(message.header.stamp).time_since_epoch(), arc(5.0).inverse() * arc(t), "lidar_2");
  };
  const Outcome out = run(drive);
  expect_continuous(out, 999);
  EXPECT_LT(error(out), 0.1);
  EXPECT_EQ(out.sensor("lidar").health, SensorStatus::HEALTHY);
}

// A recording that starts over: the runner's time never goes back, so the component is driven by hand.
TEST(StateEstimatorComponent, AClockThatJumpsBackKeepsThePoseAndGoesOn) {
  adit::testing::Harness harness(0, nullptr, Clock::Source::simulated);
  auto component = components::create("state_estimator");
  ASSERT_TRUE(component) << component.error().message;
  harness.add(*std::move(component), estimator());
  std::vector<Odometry> poses;
  std::vector<FusionStatus> status;
  harness.bus.topic("/odometry").tap(into(poses));
  harness.bus.topic("/status").tap(into(status));
  harness.set_time(Time(begin));
  harness.start();
  const auto play = [&](Duration from, int steps) {
    for (int i = 0; i < steps; ++i) {
      const Time now(from + i * 10ms);
      harness.set_time(now);
      harness.step();
      const double t = 0.01 * i;
      for (const auto& [topic, every] : {std::pair{"/lidar", 10}, std::pair{"/thermal", 4}}) {
        if (i % every != 0) continue;
        MessageInfo info;
        info.source_time = info.received_time = now;
        const Odometry message = odometry(now.time_since_epoch(), arc(t), topic);
        harness.bus.topic(topic).inject(std::make_shared<const Odometry>(message), {}, {}, info);
        harness.step();
      }
    }
  };
  for (const Duration back : {Duration(begin - 500s), Duration(begin + 2s)}) {  // by minutes, and by half a second
    poses.clear();
    play(begin, 250);
    const std::size_t before = poses.size();
    ASSERT_GT(before, 200u);
    const auto at_jump = poses.back().pose.pose.position;
    play(back, 250);
    EXPECT_TRUE(harness.failures().empty());
    ASSERT_GT(poses.size(), before + 200);
    for (const Odometry& pose : poses) ASSERT_TRUE(finite(pose));
    const auto after = poses[before].pose.pose.position;
    EXPECT_LT(std::hypot(after.x - at_jump.x, after.y - at_jump.y), 0.5);
    EXPECT_NEAR(poses.back().twist.twist.linear.x, 2.49 * speed / 4.0, 0.1);
    EXPECT_EQ(status.back().mode, FusionStatus::MODE_FUSED);
    EXPECT_LT(to_time(poses.back().header.stamp).time_since_epoch(), back + 2500ms);
  }
}

}  // namespace
}  // namespace adit::state_estimator::test
