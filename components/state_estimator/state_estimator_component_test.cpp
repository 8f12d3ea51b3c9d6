// The component as a deployment has it: synthetic odometries in, pose, transform and status out, in simulated time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "adit_msgs/msg/fusion_status.hpp"
#include "components/geometry/se3.hpp"
#include "components/runtime/component_core.hpp"
#include "components/runtime/inline_scheduler.hpp"
#include "components/runtime/local_bus.hpp"
#include "components/runtime/log_sink.hpp"
#include "components/runtime/offline_runner.hpp"
#include "components/runtime/registry.hpp"
#include "components/runtime/stamp.hpp"
#include "components/runtime/testing/recording.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/nav_sat_fix.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace adit {
namespace {

using testing::into;
using testing::Recording;

using namespace std::chrono_literals;
using adit_msgs::msg::FusionStatus;
using adit_msgs::msg::SensorStatus;
using nav_msgs::msg::Odometry;
using ::testing::HasSubstr;
using tf2_msgs::msg::TFMessage;

constexpr double speed = 5.0, curvature = 0.02;
constexpr Duration begin = 1000s;

// From rest to `speed` in 4 s, then on: 40 m in 10 s.
double way(double t) {
  return t < 4.0 ? speed * t * t / 8.0 : speed * (t - 2.0);
}

// Along an arc, from the origin along x.
Pose arc(double t) {
  Pose pose = Pose::Identity();
  const double heading = curvature * way(t);
  pose.linear() = so3_exp({0.0, 0.0, heading});
  pose.translation() << std::sin(heading) / curvature, (1.0 - std::cos(heading)) / curvature, 0.0;
  return pose;
}

Odometry odometry(Duration stamp, const Pose& pose, const std::string& frame) {
  Odometry message;
  message.header.stamp = to_stamp(Time(stamp));
  message.header.frame_id = frame;
  const Eigen::Vector3d t = pose.translation();
  const Eigen::Quaterniond q(pose.linear());
  message.pose.pose.position = {t.x(), t.y(), t.z()};
  message.pose.pose.orientation = {q.x(), q.y(), q.z(), q.w()};
  return message;
}

void set_covariance(Odometry& message, const std::array<double, 6>& variances) {
  for (std::size_t i = 0; i < 6; ++i) message.pose.covariance[7 * i] = variances[i];
}

struct Drive {
  bool lidar = true, thermal = true;
  Duration length = 10s;
  using Change = std::function<void(Odometry&, Duration& arrival, int index)>;
  Change change_lidar = nullptr;
  Change change_thermal = nullptr;
  std::function<void(sensor_msgs::msg::NavSatFix&, double t)> fix = nullptr;  // 5 Hz where set

  Recording record() const {
    Recording recording;
    recording.add("/elsewhere", Time(begin), std::make_shared<Odometry>());
    const auto play = [&](const std::string& topic, Duration period, Duration latency, const auto& change) {
      for (int i = 0; i * period <= length; ++i) {
        const Duration stamp = begin + i * period;
        Odometry message = odometry(stamp, arc(std::chrono::duration<double>(i * period).count()), topic);
        Duration arrival = stamp + latency;
        if (change) change(message, arrival, i);
        recording.add(topic, Time(arrival), std::make_shared<Odometry>(message));
      }
    };
    if (lidar) play("/lidar", 100ms, 70ms, change_lidar);
    if (thermal) play("/thermal", 40ms, 15ms, change_thermal);
    for (int i = 0; fix && i * 200ms <= length; ++i) {
      sensor_msgs::msg::NavSatFix message;
      message.header.stamp = to_stamp(Time(begin + i * 200ms));
      fix(message, 0.2 * i);
      recording.add("/fix", Time(begin + i * 200ms + 100ms), std::make_shared<sensor_msgs::msg::NavSatFix>(message));
    }
    recording.add("/elsewhere", Time(begin + length), std::make_shared<Odometry>());
    recording.sort();
    return recording;
  }
};

struct Outcome {
  std::vector<Odometry> poses;
  std::vector<TFMessage> transforms;
  std::vector<FusionStatus> status;
  std::vector<std::byte> bytes;

  const SensorStatus& sensor(const std::string& name) const {
    static const SensorStatus none;
    if (status.empty()) return none;
    for (const auto& s : status.back().sensors) {
      if (s.name == name) return s;
    }
    ADD_FAILURE() << "no sensor " << name;
    return none;
  }
  Eigen::Vector3d end() const {
    const auto& p = poses.back().pose.pose.position;
    return {p.x, p.y, p.z};
  }
};

// Of the last pose, which is of a moment after the last stamp.
double error(const Outcome& out) {
  const Duration last = to_time(out.poses.back().header.stamp).time_since_epoch() - begin;
  return (out.end() - arc(std::chrono::duration<double>(last).count()).translation()).norm();
}

ComponentConfig estimator(Value::Map parameters = {}) {
  ComponentConfig config;
  config.type = config.name = "state_estimator";
  config.log_level = LogLevel::off;
  config.parameters = std::move(parameters);
  return config;
}

bool finite(const Odometry& m) {
  const auto& p = m.pose.pose.position;
  const auto& q = m.pose.pose.orientation;
  const auto& v = m.twist.twist;
  double sum = p.x + p.y + p.z + v.linear.x + v.angular.z;
  for (const double c : m.pose.covariance) sum += c;
  for (const double c : m.twist.covariance) sum += c;
  return std::isfinite(sum) && std::abs(Eigen::Quaterniond(q.w, q.x, q.y, q.z).norm() - 1.0) < 1e-9 &&
         m.pose.covariance[0] >= 0.0 && m.pose.covariance[7] >= 0.0 && m.pose.covariance[35] >= 0.0;
}

// Whatever went in: an output each 10 ms, finite, with its transform and status.
void expect_continuous(const Outcome& out, std::size_t at_least) {
  ASSERT_GE(out.poses.size(), at_least);
  ASSERT_EQ(out.transforms.size(), out.poses.size());
  ASSERT_EQ(out.status.size(), out.poses.size());
  for (std::size_t i = 0; i < out.poses.size(); ++i) {
    const Odometry& m = out.poses[i];
    ASSERT_TRUE(finite(m)) << i;
    EXPECT_EQ(m.header.frame_id, "odom");
    EXPECT_EQ(m.child_frame_id, "base_link");
    if (i > 0) {
      EXPECT_EQ(to_time(m.header.stamp) - to_time(out.poses[i - 1].header.stamp), 10ms) << i;
    }
    ASSERT_EQ(out.transforms[i].transforms.size(), 1u);
    const auto& tf = out.transforms[i].transforms[0];
    EXPECT_EQ(to_time(tf.header.stamp), to_time(m.header.stamp));
    EXPECT_EQ(tf.header.frame_id, "odom");
    EXPECT_EQ(tf.child_frame_id, "base_link");
    EXPECT_EQ(tf.transform.translation.x, m.pose.pose.position.x);
    EXPECT_EQ(tf.transform.translation.y, m.pose.pose.position.y);
    EXPECT_EQ(tf.transform.rotation.z, m.pose.pose.orientation.z);
    const FusionStatus& s = out.status[i];
    ASSERT_TRUE(std::isfinite(s.along_track_sigma + s.cross_track_sigma + s.yaw_sigma + s.distance + s.thermal_scale));
    for (const auto& sensor : s.sensors) ASSERT_TRUE(std::isfinite(sensor.nis + sensor.weight + sensor.age));
  }
}

Outcome run(const Drive& drive, Value::Map parameters = {}) {
  Outcome out;
  auto runner = OfflineRunner::build({estimator(std::move(parameters))});
  EXPECT_TRUE(runner) << runner.error().message;
  if (!runner) return out;
  (*runner)->tap("/odometry", into(out.poses));
  (*runner)->tap("/tf", into(out.transforms));
  (*runner)->tap("/status", into(out.status));
  (*runner)->tap_cdr("/odometry", [&](Bytes cdr, Time) { out.bytes.insert(out.bytes.end(), cdr.begin(), cdr.end()); });
  Recording recording = drive.record();
  const auto stats = (*runner)->run(recording);
  EXPECT_TRUE(stats) << stats.error().message;
  return out;
}

TEST(StateEstimatorComponent, FusesBothIntoPoseTransformAndStatus) {
  const Outcome out = run({});
  expect_continuous(out, 999);
  EXPECT_LT(error(out), 0.05);
  EXPECT_NEAR(out.poses.back().twist.twist.linear.x, speed, 0.05);
  EXPECT_NEAR(out.poses.back().twist.twist.angular.z, curvature * speed, 0.01);
  const FusionStatus& last = out.status.back();
  EXPECT_EQ(out.status.front().mode, FusionStatus::MODE_INITIALIZING);
  EXPECT_EQ(last.mode, FusionStatus::MODE_FUSED);
  EXPECT_FALSE(last.stationary);
  EXPECT_NEAR(last.distance, 40.0, 0.5);
  EXPECT_NEAR(last.thermal_scale, 1.0, 0.02);
  ASSERT_EQ(last.sensors.size(), 2u);
  for (const char* name : {"lidar", "thermal"}) {
    EXPECT_EQ(out.sensor(name).health, SensorStatus::HEALTHY) << name;
    EXPECT_EQ(out.sensor(name).reason, "");
    EXPECT_EQ(out.sensor(name).rejected, 0u);
    EXPECT_GT(out.sensor(name).gate, 10.0);
  }
  EXPECT_NEAR(static_cast<double>(out.sensor("lidar").accepted), 98.0, 2.0);
  EXPECT_GT(out.sensor("lidar").late, 50u);  // it arrives behind thermal measurements that are newer
  EXPECT_EQ(out.bytes, run({}).bytes);
}

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

// The LiDAR looks along a featureless tunnel: its odometry sees half the speed, and its covariance says so. Its own
// frame is turned by 90 degrees, so that the direction is only right when the covariance is turned into the body.
TEST(StateEstimatorComponent, ADirectionReportedAsUnknownIsNotUsed) {
  Drive drive;
  const Pose turn(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ()));
  drive.change_lidar = [&](Odometry& message, Duration&, int i) {
    message = odometry(to_time(message.header.stamp).time_since_epoch(),
                       turn * Pose(Eigen::Translation3d(0.5 * way(0.1 * i), 0.0, 0.0)), "lidar");
    set_covariance(message, {1e-4, 1e4, 1e-4, 1e-6, 1e-6, 1e-6});
  };
  drive.change_thermal = [](Odometry& message, Duration&, int i) {
    message = odometry(to_time(message.header.stamp).time_since_epoch(),
                       Pose(Eigen::Translation3d(way(0.04 * i), 0.0, 0.0)), "thermal");
  };
  const Outcome used = run(drive);
  expect_continuous(used, 999);
  EXPECT_LT((used.end() - Eigen::Vector3d(40.0, 0.0, 0.0)).norm(), 1.0);
  EXPECT_EQ(used.status.back().mode, FusionStatus::MODE_FUSED);
  EXPECT_EQ(used.sensor("lidar").degrees_of_freedom, 2);
  EXPECT_EQ(used.sensor("lidar").rejected, 0u);

  const Outcome ignored = run(drive, {{"lidar_covariance", false}});
  expect_continuous(ignored, 999);
  EXPECT_GT((ignored.end() - Eigen::Vector3d(40.0, 0.0, 0.0)).norm(), 2.0);  // the wrong speed is believed
}

TEST(StateEstimatorComponent, SurvivesBadMessages) {
  const double infinity = std::numeric_limits<double>::infinity(), nan = std::nan("");
  Drive drive;
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
  Drive drive;
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

// A sensor on its head that looks backwards, of an odometry that begins at the sensor's pose.
TEST(StateEstimatorComponent, UsesTheSensorsPlaceOnTheBody) {
  Pose mounted = Pose::Identity();
  mounted.linear() =
      (Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  mounted.translation() << -2.0, 0.3, 1.0;
  const Eigen::Quaterniond q(mounted.linear());
  Drive drive{.thermal = false};
  drive.change_lidar = [&](Odometry& message, Duration&, int i) {
    message =
        odometry(to_time(message.header.stamp).time_since_epoch(), mounted.inverse() * arc(0.1 * i) * mounted, "lidar");
  };
  const Outcome out = run(drive, {{"lidar_pose", Value::List{-2.0, 0.3, 1.0, q.x(), q.y(), q.z(), q.w()}}});
  expect_continuous(out, 999);
  EXPECT_LT(error(out), 0.3);
  const auto& o = out.poses.back().pose.pose.orientation;
  EXPECT_LT(std::abs(o.x) + std::abs(o.y), 1e-6);  // level
}

TEST(StateEstimatorComponent, NamesAWrongParameter) {
  const std::vector<std::pair<Value::List, std::string>> cases = {
      {Value::List{1.0, 2.0, 3.0}, "lidar_pose: 7 numbers"},
      {Value::List{0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0}, "lidar_pose: not finite, or the quaternion"},
  };
  for (const auto& [value, message] : cases) {
    auto runner = OfflineRunner::build({estimator({{"lidar_pose", value}})});
    ASSERT_TRUE(runner);
    Recording recording = Drive{}.record();
    const auto stats = (*runner)->run(recording);
    ASSERT_FALSE(stats);
    EXPECT_THAT(stats.error().message, HasSubstr(message));
  }
}

// An odometry 4 % short, and a receiver in a country where odom's x axis points 70 degrees north of east: the first 40
// m show how the frames lie, from there on the fixes hold the position, but the one wrong by 30 m.
TEST(StateEstimatorComponent, HoldsThePositionByFixes) {
  constexpr double latitude = 47.0, longitude = 15.0, turn = 70.0 * M_PI / 180.0;
  const double metres_east = 76056.7, metres_north = 111169.2;  // of a degree there (WGS 84)
  Drive drive{.thermal = false, .length = 40s};
  drive.change_lidar = [](Odometry& message, Duration&, int i) {
    Pose pose = arc(0.1 * i);
    if (0.1 * i > 14.0)
      pose.translation() = arc(14.0).translation() + 0.96 * (pose.translation() - arc(14.0).translation());
    message = odometry(to_time(message.header.stamp).time_since_epoch(), pose, "lidar");
    set_covariance(message, {4e-4, 4e-4, 1e-5, 1e-7, 1e-7, 1e-7});
  };
  drive.fix = [&](sensor_msgs::msg::NavSatFix& fix, double t) {
    const Eigen::Vector3d p = arc(t).translation();
    const double wrong = t > 30.0 && t < 31.0 ? 30.0 : 0.0;
    fix.latitude = latitude + (std::sin(turn) * p.x() + std::cos(turn) * p.y() + wrong) / metres_north;
    fix.longitude = longitude + (std::cos(turn) * p.x() - std::sin(turn) * p.y()) / metres_east;
    fix.altitude = 300.0;
    fix.status.status = 2;
    fix.position_covariance = {4e-4, 0, 0, 0, 4e-4, 0, 0, 0, 4e-4};
    fix.position_covariance_type = 2;
  };
  const Outcome without = run(drive), with = run(drive, {{"use_gnss", true}});
  expect_continuous(with, 3999);
  EXPECT_GT(error(without), 2.0);
  EXPECT_LT(error(with), 0.4);
  EXPECT_GT(with.sensor("gnss").accepted, 80u);
  EXPECT_GE(with.sensor("gnss").rejected, 4u);
  // No fix, no covariance, no number: nothing happens.
  drive.fix = [&](sensor_msgs::msg::NavSatFix& fix, double t) {
    fix.latitude = t < 10.0 ? std::nan("") : latitude;
    fix.longitude = longitude;
    fix.status.status = t < 20.0 ? 2 : -1;
    fix.position_covariance_type = t < 20.0 && t > 10.0 ? 0 : 2;
  };
  EXPECT_EQ(run(drive, {{"use_gnss", true}}).sensor("gnss").accepted, 0u);
}

// A recording that starts over: the runner's time never goes back, so the component is driven by hand.
TEST(StateEstimatorComponent, AClockThatJumpsBackKeepsThePoseAndGoesOn) {
  Clock clock(Clock::Source::simulated);
  LocalBus bus;
  InlineScheduler scheduler;
  auto component = components::create("state_estimator");
  ASSERT_TRUE(component) << component.error().message;
  ComponentCore& core = (*component)->core();
  ASSERT_TRUE(core.bind(estimator(), std::make_shared<LogSink>()));
  Environment environment;
  environment.bus = &bus;
  environment.clock = &clock;
  environment.scheduler = &scheduler;
  environment.offline = true;
  std::string failure;
  environment.on_failure = [&](ComponentCore&, const std::string& reason) { failure = reason; };
  core.connect(environment);
  std::vector<Odometry> poses;
  std::vector<FusionStatus> status;
  bus.topic("/odometry").tap(into(poses));
  bus.topic("/status").tap(into(status));
  clock.set(Time(begin));
  ASSERT_TRUE(core.configure());
  ASSERT_TRUE(core.activate());
  const auto play = [&](Duration from, int steps) {
    for (int i = 0; i < steps; ++i) {
      const Time now(from + i * 10ms);
      const auto step = clock.set(now);
      core.time_changed(step);
      scheduler.run_until_idle();
      const double t = 0.01 * i;
      for (const auto& [topic, every] : {std::pair{"/lidar", 10}, std::pair{"/thermal", 4}}) {
        if (i % every != 0) continue;
        MessageInfo info;
        info.source_time = info.received_time = now;
        const Odometry message = odometry(now.time_since_epoch(), arc(t), topic);
        bus.topic(topic).inject(std::make_shared<const Odometry>(message), {}, {}, info);
        scheduler.run_until_idle();
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
    EXPECT_EQ(failure, "");
    ASSERT_GT(poses.size(), before + 200);
    for (const Odometry& pose : poses) ASSERT_TRUE(finite(pose));
    const auto after = poses[before].pose.pose.position;
    EXPECT_LT(std::hypot(after.x - at_jump.x, after.y - at_jump.y), 0.5);
    EXPECT_NEAR(poses.back().twist.twist.linear.x, 2.49 * speed / 4.0, 0.1);
    EXPECT_EQ(status.back().mode, FusionStatus::MODE_FUSED);
    EXPECT_LT(to_time(poses.back().header.stamp).time_since_epoch(), back + 2500ms);
  }
  core.shutdown();
}

// A simulator that lets time go on in steps of 70 ms: consumers of the pose still get one each 10 ms.
TEST(StateEstimatorComponent, PublishesWhatWasDueWithinAStepOfSimulatedTime) {
  Clock clock(Clock::Source::simulated);
  LocalBus bus;
  InlineScheduler scheduler;
  auto component = components::create("state_estimator");
  ASSERT_TRUE(component);
  ComponentCore& core = (*component)->core();
  ASSERT_TRUE(core.bind(estimator(), std::make_shared<LogSink>()));
  Environment environment;
  environment.bus = &bus;
  environment.clock = &clock;
  environment.scheduler = &scheduler;
  environment.offline = true;
  core.connect(environment);
  std::vector<Odometry> poses;
  bus.topic("/odometry").tap(into(poses));
  clock.set(Time(begin));
  ASSERT_TRUE(core.configure());
  ASSERT_TRUE(core.activate());
  for (int i = 1; i <= 20; ++i) {
    core.time_changed(clock.set(Time(begin + i * 70ms)));
    scheduler.run_until_idle();
  }
  ASSERT_EQ(poses.size(), 140u);
  for (std::size_t i = 1; i < poses.size(); ++i) {
    EXPECT_EQ(to_time(poses[i].header.stamp) - to_time(poses[i - 1].header.stamp), 10ms) << i;
  }
  core.shutdown();
}

}  // namespace
}  // namespace adit
