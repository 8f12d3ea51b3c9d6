// The component as a deployment has it: frames, clouds and an odometry that drifts in; closures and corrections out.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "components/geometry/rigid.hpp"
#include "components/runtime/offline_runner.hpp"
#include "components/runtime/stamp.hpp"
#include "components/runtime/testing/recording.hpp"
#include "components/thermal_odometry/test_scene.hpp"
#include "geometry_msgs/msg/pose_with_covariance_stamped.hpp"
#include "idl/point_cloud_writer.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/camera_info.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace adit {
namespace {

using namespace std::chrono_literals;
using adit_msgs::msg::ThermalFrame;
using geometry_msgs::msg::PoseWithCovarianceStamped;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::CameraInfo;
using sensor_msgs::msg::PointCloud2;
using ::testing::HasSubstr;
using testing::into;
using testing::Recording;
using tf2_msgs::msg::TFMessage;
using thermal_odometry::TestScene;

Value::List numbers(const Pose& pose) {
  const std::array<double, 7> v = numbers_of(pose);
  return Value::List(v.begin(), v.end());
}

struct Outcome {
  std::vector<PoseWithCovarianceStamped> closures;
  std::vector<TFMessage> corrections;
  std::string reason;
  Pose true_end = Pose::Identity();
  Pose odometry_end = Pose::Identity();
};

// 18 m ahead and 16 m back in reverse, a keyframe every 2 m; the odometry creeps ahead by 3 cm each.
Outcome run(Value::Map parameters) {
  Outcome out;
  Recording recording;
  TestScene scene;
  auto info = std::make_shared<CameraInfo>();
  info->width = static_cast<std::uint32_t>(scene.camera.width);
  info->height = static_cast<std::uint32_t>(scene.camera.height);
  info->distortion_model = "plumb_bob";
  info->k = {scene.camera.fx, 0, scene.camera.cx, 0, scene.camera.fy, scene.camera.cy, 0, 0, 1};
  Time stamp(100s);
  recording.add("/camera_info", stamp, std::move(info));
  Pose last = Pose::Identity();
  for (int i = 0; i < 18; ++i, stamp += 1s) {
    Pose truth = TestScene::drive(0.3 * i, 0.0);
    truth.translation().z() = 2.05 * (i < 10 ? i : 18 - i);
    Pose motion = last.inverse() * truth;
    motion.translation().z() += 0.03;
    out.odometry_end = out.odometry_end * motion;
    out.true_end = last = truth;
    const auto scan = scene.scan(truth, 0);
    std::vector<LidarPoint> points;
    for (const Eigen::Vector3f& p : scan.points) points.push_back({p.x(), p.y(), p.z(), 1.0F, 0.0, 0});
    auto cloud = std::make_shared<PointCloud2>();
    cloud->header.stamp = to_stamp(stamp);
    EXPECT_TRUE(write_points(points, 1, PointLayout::xyzi, *cloud));
    recording.add("/points", stamp, std::move(cloud));
    const thermal_odometry::Frame rendered = scene.render(truth, 0);
    auto frame = std::make_shared<ThermalFrame>();
    frame->header.stamp = to_stamp(stamp);
    frame->width = static_cast<std::uint32_t>(rendered.width);
    frame->height = static_cast<std::uint32_t>(rendered.height);
    frame->step = 2 * frame->width;
    frame->data.resize(std::size_t{frame->step} * frame->height);
    std::memcpy(frame->data.mutable_data(), rendered.data, frame->data.size());
    recording.add("/frame", stamp, std::move(frame));
    auto odometry = std::make_shared<Odometry>();
    odometry->header.stamp = to_stamp(stamp + 3ms);  // the middle of the readout
    odometry->header.frame_id = "thermal_odom";
    const Eigen::Vector3d t = out.odometry_end.translation();
    const Eigen::Quaterniond q(out.odometry_end.linear());
    odometry->pose.pose.position = {t.x(), t.y(), t.z()};
    odometry->pose.pose.orientation = {q.x(), q.y(), q.z(), q.w()};
    odometry->pose.covariance[0] = 1e-4;
    recording.add("/odometry", stamp, std::move(odometry));
  }
  ComponentConfig config;
  config.type = config.name = "thermal_loop_closure";
  config.log_level = LogLevel::off;
  parameters.emplace_back("thermal_pose", numbers(Pose::Identity()));
  parameters.emplace_back("lidar_pose", numbers(TestScene::extrinsics()));
  config.parameters = std::move(parameters);
  auto runner = OfflineRunner::build({config});
  EXPECT_TRUE(runner) << runner.error().message;
  if (!runner) return out;
  (*runner)->tap("/closure", into(out.closures));
  (*runner)->tap("/correction", into(out.corrections));
  const auto stats = (*runner)->run(recording);
  EXPECT_TRUE(stats) << stats.error().message;
  for (const ComponentStatus& status : (*runner)->status()) out.reason = status.reason;
  return out;
}

TEST(ThermalLoopClosureComponent, IsOffUnlessAsked) {
  const Outcome out = run({});
  EXPECT_TRUE(out.closures.empty());
  EXPECT_EQ(out.reason, "off");
}

TEST(ThermalLoopClosureComponent, ComingBackCorrectsTheOdometry) {
  const Outcome out = run({{"enabled", true}});
  ASSERT_GE(out.closures.size(), 2u) << out.reason;
  ASSERT_EQ(out.corrections.size(), out.closures.size());
  EXPECT_THAT(out.reason, HasSubstr("18 keyframes"));
  const auto& transform = out.corrections.back().transforms.at(0);
  EXPECT_EQ(transform.header.frame_id, "thermal_map");
  EXPECT_EQ(transform.child_frame_id, "thermal_odom");
  const PoseWithCovarianceStamped& closure = out.closures.back();
  EXPECT_EQ(closure.header.frame_id, "thermal_map");
  const auto& p = closure.pose.pose.position;
  // The last keyframe closes the loop.
  const double before = (out.odometry_end.translation() - out.true_end.translation()).norm();
  const double after = (Eigen::Vector3d(p.x, p.y, p.z) - out.true_end.translation()).norm();
  EXPECT_LT(after, 0.5 * before) << before;
  for (std::size_t i = 0; i < 36; i += 7) {
    EXPECT_GT(closure.pose.covariance[i], 0.0);
    EXPECT_LT(closure.pose.covariance[i], 1.0);
  }
}

}  // namespace
}  // namespace adit
