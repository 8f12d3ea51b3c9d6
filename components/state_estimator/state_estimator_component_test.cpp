// The component as a deployment has it: synthetic odometries in, pose, transform and status out, in simulated time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "components/runtime/offline_runner.hpp"
#include "components/runtime/registry.hpp"
#include "components/runtime/stamp.hpp"
#include "components/runtime/testing/harness.hpp"
#include "components/state_estimator/component_drive.hpp"

namespace adit::state_estimator::test {
namespace {

using adit::testing::into;
using ::testing::HasSubstr;

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

TEST(StateEstimatorComponent, CarriesTheFrontEndsDoubtsOfThemselves) {
  SyntheticDrive drive;
  drive.lidar_matches = [](double t) { return t < 5.0 ? 8000U : 900U; };  // smoke
  drive.thermal_health = [](adit_msgs::msg::ThermalHealth& m, double t) {
    m.scale_sigma = static_cast<float>(0.004 + (t < 8.0 ? 0.002 : 0.004) * std::max(0.0, t - 5.0));
  };
  const Outcome out = run(drive, {{"thermal_scale_sigma", 0.003}});
  expect_continuous(out, 999);
  EXPECT_LT(error(out), 0.05);
  EXPECT_EQ(out.sensor("lidar").health, SensorStatus::DEGRADED);
  EXPECT_EQ(out.sensor("lidar").reason, "in doubt by its own account");
  EXPECT_EQ(out.sensor("thermal").health, SensorStatus::HEALTHY);
  const auto scale_sigma = [&](double t) {
    return out.status[static_cast<std::size_t>(100.0 * t)].thermal_scale_sigma;
  };
  EXPECT_LE(scale_sigma(4.9), 0.0031);
  EXPECT_GT(scale_sigma(9.9), scale_sigma(4.9));

  drive.lidar_matches = nullptr;
  drive.thermal_health = [](adit_msgs::msg::ThermalHealth& m, double) {
    m.flags = adit_msgs::msg::ThermalHealth::FLAG_SATURATED;
    m.scale_sigma = std::nanf("");  // no account of the scale, and no harm
  };
  const Outcome saturated = run(drive);
  EXPECT_LT(error(saturated), 0.05);
  EXPECT_EQ(saturated.sensor("thermal").reason, "in doubt by its own account");
  EXPECT_EQ(saturated.sensor("lidar").reason, "");

  drive.thermal_health = [](adit_msgs::msg::ThermalHealth& m, double t) { m.residual_rms = t < 5.0 ? 0.5F : 3.0F; };
  drive.change_thermal = [](Odometry& message, Duration&, int i) {
    if (i > 126) message.pose.pose.position.x -= 0.1 * (i - 126);  // what it aligned wrongly
  };
  drive.lidar = false;
  drive.length = 6s;
  const Outcome misfit = run(drive);
  EXPECT_LT(error(misfit), 0.6);  // a second of coasting along the arc; fused, it would be 2.5 m
  EXPECT_EQ(misfit.sensor("thermal").reason, "its data is not fused");

  drive.thermal_health = [](adit_msgs::msg::ThermalHealth& m, double t) {
    m.active_points = t < 5.0 ? 400 : 60;
  };  // fog
  const Outcome few_points = run(drive);
  EXPECT_LT(error(few_points), 0.6);
  EXPECT_EQ(few_points.sensor("thermal").reason, "its data is not fused");
}

// The LiDAR looks along a featureless tunnel: its odometry sees half the speed, and its covariance says so. Its own
// frame is turned by 90 degrees, so that the direction is only right when the covariance is turned into the body.
TEST(StateEstimatorComponent, ADirectionReportedAsUnknownIsNotUsed) {
  SyntheticDrive drive;
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

// A sensor on its head that looks backwards, of an odometry that begins at the sensor's pose.
TEST(StateEstimatorComponent, UsesTheSensorsPlaceOnTheBody) {
  Pose mounted = Pose::Identity();
  mounted.linear() =
      (Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  mounted.translation() << -2.0, 0.3, 1.0;
  const Eigen::Quaterniond q(mounted.linear());
  SyntheticDrive drive{.thermal = false};
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
    Recording recording = SyntheticDrive{}.record();
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
  SyntheticDrive drive{.thermal = false, .length = 40s};
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

// A simulator that lets time go on in steps of 70 ms: consumers of the pose still get one each 10 ms.
TEST(StateEstimatorComponent, PublishesWhatWasDueWithinAStepOfSimulatedTime) {
  adit::testing::Harness harness(0, nullptr, Clock::Source::simulated);
  auto component = components::create("state_estimator");
  ASSERT_TRUE(component) << component.error().message;
  harness.add(*std::move(component), estimator());
  std::vector<Odometry> poses;
  harness.bus.topic("/odometry").tap(into(poses));
  harness.set_time(Time(begin));
  harness.start();
  for (int i = 1; i <= 20; ++i) {
    harness.set_time(Time(begin + i * 70ms));
    harness.step();
  }
  ASSERT_EQ(poses.size(), 140u);
  for (std::size_t i = 1; i < poses.size(); ++i) {
    EXPECT_EQ(to_time(poses[i].header.stamp) - to_time(poses[i - 1].header.stamp), 10ms) << i;
  }
}

}  // namespace
}  // namespace adit::state_estimator::test
