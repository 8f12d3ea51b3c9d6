// The component as a deployment has it: clouds and an odometry that drifts in; correction, pose, maps and files out.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "components/mapping/test_tunnel.hpp"
#include "components/runtime/offline_runner.hpp"
#include "components/runtime/stamp.hpp"
#include "components/runtime/testing/recording.hpp"
#include "geometry_msgs/msg/transform_stamped.hpp"
#include "idl/point_cloud_writer.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace adit {
namespace {

using geometry_msgs::msg::TransformStamped;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::PointCloud2;
using testing::into;
using testing::Recording;
using namespace std::chrono_literals;

constexpr Duration begin = 1000s;
constexpr double step = 2.0;  // m between sweeps, 0.1 s

std::shared_ptr<Odometry> odometry(const Pose& pose, Duration time) {
  auto message = std::make_shared<Odometry>();
  message->header.stamp = to_stamp(Time(begin + time));
  message->header.frame_id = "odom";
  message->child_frame_id = "lidar";
  const Eigen::Vector3d t = pose.translation();
  const Eigen::Quaterniond q(pose.linear());
  message->pose.pose.position = {t.x(), t.y(), t.z()};
  message->pose.pose.orientation = {q.x(), q.y(), q.z(), q.w()};
  message->pose.covariance.fill(0.0);
  return message;
}

std::shared_ptr<PointCloud2> cloud(const mapping::Points& points, Duration time) {
  std::vector<LidarPoint> out;
  for (const mapping::Point& p : points) {
    out.push_back({p.position.x(), p.position.y(), p.position.z(), p.intensity, 0.0, 0});
  }
  auto message = std::make_shared<PointCloud2>();
  message->header.stamp = to_stamp(Time(begin + time));
  message->header.frame_id = "lidar";
  EXPECT_TRUE(write_points(out, 1, PointLayout::xyzi, *message));
  return message;
}

struct Outcome {
  std::vector<TransformStamped> corrections;
  std::vector<Odometry> poses;
  std::vector<PointCloud2> maps, local_maps;
  ComponentStatus status;
  Pose truth = Pose::Identity();  // at the end, from the start
};

Outcome run(double laps, const std::string& map_file, bool bad_input) {
  mapping::TestTunnel tunnel;
  tunnel.lap = 160.0;
  ComponentConfig config;
  config.type = config.name = "mapping";
  config.log_level = LogLevel::off;
  config.parameters = Value::Map{{"map_file", Value(map_file)}};
  Outcome out;
  auto runner = OfflineRunner::build({config});
  EXPECT_TRUE(runner) << runner.error().message;
  if (!runner) return out;
  (*runner)->tap("/map_odom", into(out.corrections));
  (*runner)->tap("/pose", into(out.poses));
  (*runner)->tap("/map", into(out.maps));
  (*runner)->tap("/local_map", into(out.local_maps));
  Recording recording;
  Pose drifted = Pose::Identity(), before = tunnel.at(0.0);
  int k = 0;
  for (double s = 0.0; s < laps * tunnel.lap; s += step, ++k) {
    const Duration time = k * 100ms;
    const Pose pose = tunnel.at(s);
    Pose motion = before.inverse() * pose;
    motion.translation() *= 1.01;
    drifted = drifted * motion;
    before = pose;
    recording.add("/points", Time(begin + time + 1ms), cloud(tunnel.seen_from(pose, s, 5'000, 1 + k), time));
    recording.add("/odometry", Time(begin + time + 2ms), odometry(drifted, time));
    if (!bad_input || k % 10 != 5) continue;
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    Pose broken = drifted;
    broken.translation().x() = nan;
    recording.add("/odometry", Time(begin + time + 3ms), odometry(broken, time + 10ms));
    recording.add("/odometry", Time(begin + time + 4ms), odometry(drifted, time - 1s));
    recording.add("/points", Time(begin + time + 5ms), cloud({{{NAN, NAN, NAN}, 0.0F}}, time + 1ms));
    auto headless = std::make_shared<PointCloud2>();  // says it has points, and has none
    headless->width = 1000;
    headless->height = 1;
    recording.add("/points", Time(begin + time + 6ms), headless);
  }
  out.truth = tunnel.at(0.0).inverse() * before;
  const auto done = (*runner)->run(recording);
  EXPECT_TRUE(done) << done.error().message;
  out.status = (*runner)->status().front();
  return out;
}

double error_of(const Odometry& pose, const Pose& truth) {
  const auto& p = pose.pose.pose.position;
  return (Eigen::Vector3d(p.x, p.y, p.z) - truth.translation()).norm();
}

TEST(MappingComponent, ClosesTheLoopInTheMapAndLeavesOdomAlone) {
  const std::string file = ::testing::TempDir() + "mapping_component_test.ply";
  std::filesystem::remove(file);
  const Outcome out = run(1.6, file, false);
  ASSERT_FALSE(out.corrections.empty());
  EXPECT_EQ(out.corrections.front().header.frame_id, "map");
  EXPECT_EQ(out.corrections.front().child_frame_id, "odom");
  EXPECT_EQ(out.corrections.front().transform.translation.x, 0.0);
  const auto& t = out.corrections.back().transform.translation;
  EXPECT_GT(std::hypot(t.x, t.y), 0.05);
  ASSERT_EQ(out.poses.size(), out.corrections.size());
  EXPECT_EQ(out.poses.back().header.frame_id, "map");
  EXPECT_EQ(out.poses.back().child_frame_id, "base_link");
  EXPECT_LT(error_of(out.poses.back(), out.truth), 1.0);  // 2.6 m of scale error on the way
  ASSERT_FALSE(out.maps.empty());
  EXPECT_GT(out.maps.back().width, 3'000u);
  EXPECT_EQ(out.maps.back().data.size(), out.maps.back().width * 16u);
  ASSERT_FALSE(out.local_maps.empty());
  EXPECT_GT(std::filesystem::file_size(file), 16u * 3'000u);
  EXPECT_NE(out.status.reason.find("closures"), std::string::npos);
  std::filesystem::remove(file);
}

TEST(MappingComponent, BadInputIsCountedAndChangesNothing) {
  const Outcome good = run(0.5, "", false), bad = run(0.5, "", true);
  ASSERT_FALSE(good.maps.empty());
  ASSERT_FALSE(bad.maps.empty());
  EXPECT_EQ(good.maps.back().width, bad.maps.back().width);
  EXPECT_TRUE(std::equal(good.maps.back().data.begin(), good.maps.back().data.end(), bad.maps.back().data.begin()));
  EXPECT_NE(bad.status.reason.find("poses refused"), std::string::npos) << bad.status.reason;
}

TEST(MappingComponent, AMapFileOfAnotherKindIsRefused) {
  ComponentConfig config;
  config.type = config.name = "mapping";
  config.parameters = Value::Map{{"map_file", Value(std::string("map.txt"))}};
  auto runner = OfflineRunner::build({config});
  ASSERT_TRUE(runner);
  Recording recording;
  recording.add("/odometry", Time(begin), odometry(Pose::Identity(), 0s));
  EXPECT_FALSE((*runner)->run(recording));
}

}  // namespace
}  // namespace adit
