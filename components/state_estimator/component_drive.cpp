#include "components/state_estimator/component_drive.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "adit_msgs/msg/localizability.hpp"
#include "components/runtime/offline_runner.hpp"
#include "components/runtime/stamp.hpp"

namespace adit::state_estimator::test {

using adit::testing::into;

double way(double t) {
  return t < 4.0 ? speed * t * t / 8.0 : speed * (t - 2.0);
}

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

Recording SyntheticDrive::record() const {
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
  for (int i = 0; lidar_matches && i * 100ms <= length; ++i) {
    auto message = std::make_shared<adit_msgs::msg::Localizability>();
    message->header.stamp = to_stamp(Time(begin + i * 100ms));
    message->correspondences = lidar_matches(0.1 * i);
    recording.add("/localizability", Time(begin + i * 100ms + 65ms), std::move(message));
  }
  for (int i = 0; thermal_health && i * 40ms <= length; ++i) {
    auto message = std::make_shared<adit_msgs::msg::ThermalHealth>();
    message->header.stamp = to_stamp(Time(begin + i * 40ms));
    message->active_points = 400;
    thermal_health(*message, 0.04 * i);
    recording.add("/thermal_health", Time(begin + i * 40ms + 14ms), std::move(message));
  }
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

const SensorStatus& Outcome::sensor(const std::string& name) const {
  static const SensorStatus none;
  if (status.empty()) return none;
  for (const auto& s : status.back().sensors) {
    if (s.name == name) return s;
  }
  ADD_FAILURE() << "no sensor " << name;
  return none;
}

Eigen::Vector3d Outcome::end() const {
  const auto& p = poses.back().pose.pose.position;
  return {p.x, p.y, p.z};
}

double error(const Outcome& out) {
  const Duration last = to_time(out.poses.back().header.stamp).time_since_epoch() - begin;
  return (out.end() - arc(std::chrono::duration<double>(last).count()).translation()).norm();
}

ComponentConfig estimator(Value::Map parameters) {
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

Outcome run(const SyntheticDrive& drive, Value::Map parameters) {
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

}  // namespace adit::state_estimator::test
