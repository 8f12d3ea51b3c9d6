// The component as a deployment has it: clouds of a generated tunnel and a live odometry in; pose, covariance and
// localizability out, in simulated time.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "adit_msgs/msg/localizability.hpp"
#include "components/lidar_odometry/test_scene.hpp"
#include "components/runtime/offline_runner.hpp"
#include "components/runtime/stamp.hpp"
#include "components/runtime/testing/recording.hpp"
#include "idl/point_cloud_writer.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/imu.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit {
namespace {

using testing::into;
using testing::Recording;

using namespace std::chrono_literals;
using adit_msgs::msg::Localizability;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::PointCloud2;

constexpr Duration begin = 1000s;
constexpr int sweeps = 20;

struct Motion {
  Pose pose = Pose::Identity();
  Vector6d twist = Vector6d::Zero();
};

// At rest for 0.5 s, then with 2 m/s^2 along the tunnel.
Motion drive(double t) {
  Motion motion;
  const double moving = std::max(0.0, t - 0.5);
  motion.pose.translation().x() = moving * moving;
  motion.twist[0] = 2.0 * moving;
  return motion;
}

// The LiDAR looks backwards, 1 m ahead of the body.
Pose mounting() {
  Pose pose = Pose::Identity();
  pose.linear() = so3_exp({0.0, 0.0, M_PI});
  pose.translation() << 1.0, 0.0, 0.0;
  return pose;
}

std::shared_ptr<PointCloud2> cloud(const lidar_odometry::Scene& scene, int k) {
  const double end = 0.1 * (k + 1);
  const Motion body = drive(end);
  lidar_odometry::ScannerModel model;
  model.rings = 64;
  // The scanner's twist in its own frame.
  const Vector6d twist = se3_adjoint(mounting().inverse()) * drive(end - 0.05).twist;
  const auto sweep = lidar_odometry::scan(scene, model, body.pose * mounting(), twist, 0, static_cast<unsigned>(k));
  std::vector<LidarPoint> points;
  for (std::size_t i = 0; i < sweep.points.size(); ++i) {
    const auto& p = sweep.points[i];
    points.push_back({p.x(), p.y(), p.z(), 0.0f, static_cast<double>(sweep.seconds[i]),
                      static_cast<std::uint16_t>(i / sweep.width)});
  }
  auto message = std::make_shared<PointCloud2>();
  message->header.stamp = to_stamp(Time(begin + k * 100ms));
  message->header.frame_id = "lidar";
  EXPECT_TRUE(write_points(points, 64, PointLayout::velodyne, *message));
  return message;
}

// A filter that knows speed and heading only, 2 % wrong, as base_link's odometry.
std::shared_ptr<Odometry> filter(Duration time, double jump = 0.0) {
  const Motion body = drive(std::chrono::duration<double>(time).count());
  auto message = std::make_shared<Odometry>();
  message->header.stamp = to_stamp(Time(begin + time));
  message->pose.pose.position.x = 1.02 * body.pose.translation().x() + jump;
  message->pose.pose.orientation.w = 1.0;
  message->twist.twist.linear.x = 1.02 * body.twist[0];
  message->twist.covariance.fill(0.0);
  const double variances[6] = {0.0025, 1e6, 1e6, 1e6, 1e6, 1e-4};
  for (std::size_t i = 0; i < 6; ++i) message->twist.covariance[7 * i] = variances[i];
  return message;
}

struct Outcome {
  std::vector<Odometry> poses;
  std::vector<Localizability> localizability;
  std::vector<std::byte> bytes;
  std::string health;                                                  // at the end
  double along() const { return -poses.back().pose.pose.position.x; }  // the odometry's x looks backwards
};

const std::vector<std::shared_ptr<PointCloud2>>& clouds(bool smooth) {
  const auto make = [](const lidar_odometry::Scene& scene) {
    std::vector<std::shared_ptr<PointCloud2>> made;
    for (int k = 0; k < sweeps; ++k) made.push_back(cloud(scene, k));
    return made;
  };
  static const auto featureless = make(lidar_odometry::smooth_tunnel());
  static const auto furnished = make(lidar_odometry::furnished_tunnel());
  return smooth ? featureless : furnished;
}

using More = std::function<void(Recording&)>;

Outcome run(bool smooth, const std::string& kind, const More& more = nullptr, const Value::Map& extra = {}) {
  ComponentConfig config;
  config.type = config.name = "lidar_odometry";
  config.log_level = LogLevel::off;
  Value::Map parameters{{"use_prior", Value(!kind.empty())}};
  if (!kind.empty()) {
    parameters.emplace_back("prior_kind", Value(kind));
    parameters.emplace_back("lidar_pose", Value(Value::List{1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0}));
  }
  parameters.insert(parameters.end(), extra.begin(), extra.end());
  config.parameters = std::move(parameters);
  Outcome out;
  auto runner = OfflineRunner::build({config});
  EXPECT_TRUE(runner) << runner.error().message;
  if (!runner) return out;
  (*runner)->tap("/odometry", into(out.poses));
  (*runner)->tap("/localizability", into(out.localizability));
  const auto bytes = [&](Bytes cdr, Time) { out.bytes.insert(out.bytes.end(), cdr.begin(), cdr.end()); };
  (*runner)->tap_cdr("/odometry", bytes);
  (*runner)->tap_cdr("/localizability", bytes);
  Recording recording;
  for (int k = 0; k < sweeps; ++k) recording.add("/points", Time(begin + (k + 1) * 100ms + 5ms), clouds(smooth)[k]);
  for (Duration t = 0ms; t < 2200ms; t += 10ms) recording.add("/prior", Time(begin + t + 1ms), filter(t));
  if (more) more(recording);
  recording.sort();
  const auto done = (*runner)->run(recording);
  EXPECT_TRUE(done) << done.error().message;
  out.health = (*runner)->status().front().reason;
  return out;
}

TEST(LidarOdometryComponent, IsTheHonestModeByDefaultAndSaysWhatItSees) {
  const Outcome out = run(false, "");
  ASSERT_EQ(out.poses.size(), static_cast<std::size_t>(sweeps));
  ASSERT_EQ(out.localizability.size(), out.poses.size() - 1);  // the first sweep is the map
  EXPECT_NEAR(out.along(), drive(2.0).pose.translation().x(), 0.05);
  const Odometry& last = out.poses.back();
  EXPECT_EQ(last.header.frame_id, "odom");
  EXPECT_EQ(last.child_frame_id, "lidar");
  EXPECT_NEAR(last.twist.twist.linear.x, -drive(1.95).twist[0], 0.2);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_GT(last.pose.covariance[7 * i], 0.0);
    EXPECT_LT(last.pose.covariance[7 * i], i < 3 ? 1e-3 : 1e-4);
  }
  const Localizability& l = out.localizability.back();
  EXPECT_EQ(l.header.stamp, last.header.stamp);
  EXPECT_EQ(l.header.frame_id, "lidar");
  EXPECT_FALSE(l.degenerate);
  EXPECT_GT(l.correspondences, 500u);
  EXPECT_GT(l.residual_sigma, 0.001);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(l.translation_class[i], Localizability::LOCALIZABLE);
    EXPECT_EQ(l.rotation_class[i], Localizability::LOCALIZABLE);
    EXPECT_NEAR(l.translation_sigma[i], 1.0 / std::sqrt(l.translation_information[i]), 1e-9);
  }
}

TEST(LidarOdometryComponent, SaysThatATunnelsAxisIsNotSeenAndLeavesThePriorOut) {
  for (const char* kind : {"", "velocity"}) {
    const Outcome out = run(true, kind);
    ASSERT_EQ(out.localizability.size(), static_cast<std::size_t>(sweeps - 1));
    for (std::size_t k = 0; k < out.localizability.size(); ++k) {
      const Localizability& l = out.localizability[k];
      EXPECT_TRUE(l.degenerate);
      EXPECT_NE(l.translation_class[0], Localizability::LOCALIZABLE) << k;
      EXPECT_GT(std::abs(l.translation_directions[0]), 0.999);
      EXPECT_TRUE(std::isfinite(l.translation_sigma[0]));
      const auto& covariance = out.poses[k + 1].pose.covariance;
      EXPECT_GT(covariance[0], 1e-3) << k;  // the tunnel's axis, also with a prior that knows it
      EXPECT_LT(covariance[7], 1e-3);
      EXPECT_LT(covariance[14], 1e-3);
    }
  }
}

TEST(LidarOdometryComponent, FollowsALivePriorWhereNothingElseKnowsTheWay) {
  const double truth = drive(2.0).pose.translation().x();
  for (const char* kind : {"velocity", "pose"}) {
    EXPECT_NEAR(run(true, kind).along(), 1.02 * truth, 0.15) << kind;
    EXPECT_NEAR(run(false, kind).along(), truth, 0.05) << kind;  // the match decides where it can
  }
  EXPECT_LT(run(true, "").along(), 0.5 * truth);
}

TEST(LidarOdometryComponent, RepeatedAndLatePriorsChangeNothing) {
  const Outcome once = run(true, "velocity");
  EXPECT_EQ(once.bytes, run(true, "velocity").bytes);
  const Outcome again = run(true, "velocity", [](Recording& recording) {
    for (Duration t = 0ms; t < 2000ms; t += 30ms) {
      recording.add("/prior", Time(begin + t + 2ms), filter(t));
      recording.add("/prior", Time(begin + t + 53ms), filter(t, 5.0));
    }
  });
  EXPECT_EQ(once.bytes, again.bytes);
}

// The odometry stops half way: no cloud waits for it, and the velocity of then goes on.
TEST(LidarOdometryComponent, GoesOnWhenALivePriorStops) {
  ComponentConfig config;
  config.type = config.name = "lidar_odometry";
  config.log_level = LogLevel::off;
  config.parameters = Value::Map{{"use_prior", Value(true)},
                                 {"prior_kind", Value(std::string("velocity"))},
                                 {"lidar_pose", Value(Value::List{1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0})}};
  std::vector<Odometry> poses;
  auto runner = OfflineRunner::build({config});
  ASSERT_TRUE(runner);
  (*runner)->tap("/odometry", into(poses));
  Recording recording;
  for (int k = 0; k < sweeps; ++k) recording.add("/points", Time(begin + (k + 1) * 100ms + 5ms), clouds(true)[k]);
  for (Duration t = 0ms; t < 1200ms; t += 10ms) recording.add("/prior", Time(begin + t + 1ms), filter(t));
  recording.sort();
  ASSERT_TRUE((*runner)->run(recording));
  ASSERT_EQ(poses.size(), static_cast<std::size_t>(sweeps));
  const double expected = 1.02 * (drive(1.2).pose.translation().x() + 0.8 * drive(1.2).twist[0]);
  EXPECT_NEAR(-poses.back().pose.pose.position.x, expected, 0.3);
}

// What an IMU half a metre behind the LiDAR measures on that drive.
More imu(Duration delay, Duration until = 3s, bool broken = false) {
  return [=](Recording& recording) {
    for (Duration t = 0ms; t < std::min<Duration>(until, 2200ms); t += 5ms) {
      auto message = std::make_shared<sensor_msgs::msg::Imu>();
      message->header.stamp = to_stamp(Time(begin + t));
      message->linear_acceleration = {t < 500ms ? 0.0 : 2.0, 0.0, 9.81};
      if (broken) message->angular_velocity.x = std::nan("");
      recording.add("/imu", Time(begin + t + delay), message);
    }
  };
}
const Value::Map with_imu{{"use_imu", Value(true)},
                          {"lidar_pose", Value(Value::List{1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0})},
                          {"imu_pose", Value(Value::List{0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0})}};

TEST(LidarOdometryComponent, AnImuCarriesTheAxisOfASmoothTunnel) {
  const double truth = drive(2.0).pose.translation().x();
  const Outcome out = run(true, "", imu(1ms), with_imu);
  ASSERT_EQ(out.poses.size(), static_cast<std::size_t>(sweeps));
  EXPECT_NEAR(out.along(), truth, 0.1);
  EXPECT_EQ(out.health.find("without IMU"), std::string::npos) << out.health;
  for (const Localizability& l : out.localizability) {
    EXPECT_TRUE(l.degenerate);  // the IMU is not what the LiDAR sees
    EXPECT_NE(l.translation_class[0], Localizability::LOCALIZABLE);
  }
  EXPECT_NEAR(run(false, "", imu(1ms), with_imu).along(), truth, 0.03);
}

TEST(LidarOdometryComponent, CloudsWaitForTheImuTheSameWhenItIsLate) {
  const Outcome prompt = run(false, "", imu(1ms), with_imu);
  const Outcome late = run(false, "", imu(60ms), with_imu);
  ASSERT_EQ(late.poses.size(), prompt.poses.size());
  EXPECT_EQ(late.bytes, prompt.bytes);
}

TEST(LidarOdometryComponent, GoesOnWithoutAnImuAndSaysSo) {
  const Outcome without = run(false, "");
  const Outcome silent = run(false, "", nullptr, with_imu);
  EXPECT_EQ(silent.bytes, without.bytes);
  EXPECT_NE(silent.health.find("20 without IMU"), std::string::npos) << silent.health;
  const Outcome broken = run(false, "", imu(1ms, 3s, true), with_imu);
  EXPECT_EQ(broken.bytes, without.bytes);
  EXPECT_NE(broken.health.find("IMU samples refused"), std::string::npos) << broken.health;
  const Outcome stops = run(false, "", imu(1ms, 1200ms), with_imu);
  ASSERT_EQ(stops.poses.size(), static_cast<std::size_t>(sweeps));
  EXPECT_NEAR(stops.along(), drive(2.0).pose.translation().x(), 0.05);
  EXPECT_NE(stops.health.find("8 without IMU"), std::string::npos) << stops.health;
}

TEST(LidarOdometryComponent, RefusesAMountingThatIsNone) {
  ComponentConfig config;
  config.type = config.name = "lidar_odometry";
  config.log_level = LogLevel::off;
  config.parameters = Value::Map{{"lidar_pose", Value(Value::List{0.0, 0.0, 0.0})}};
  auto runner = OfflineRunner::build({config});
  ASSERT_TRUE(runner);
  Recording recording;
  recording.add("/points", Time(begin + 5ms), clouds(true)[0]);
  const auto done = (*runner)->run(recording);
  ASSERT_FALSE(done);
  EXPECT_NE(done.error().message.find("lidar_pose"), std::string::npos) << done.error().message;
}

}  // namespace
}  // namespace adit
