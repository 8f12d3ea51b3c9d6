// The component as a deployment has it: rendered frames, calibration, clouds and a prior in; poses, health and picture
// out, in simulated time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "adit_msgs/msg/thermal_health.hpp"
#include "components/geometry/rigid.hpp"
#include "components/runtime/offline_runner.hpp"
#include "components/runtime/stamp.hpp"
#include "components/runtime/testing/recording.hpp"
#include "components/thermal_odometry/test_scene.hpp"
#include "idl/point_cloud_writer.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/camera_info.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit {
namespace {

using testing::into;
using testing::Recording;

using namespace std::chrono_literals;
using adit_msgs::msg::ThermalFrame;
using adit_msgs::msg::ThermalHealth;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::CameraInfo;
using sensor_msgs::msg::Image;
using sensor_msgs::msg::PointCloud2;
using ::testing::HasSubstr;
using thermal_odometry::TestScene;

constexpr double speed = 4.0;
constexpr Duration begin = 1000s;
constexpr Duration period = 40ms;

Pose camera_at(int i) {
  return TestScene::drive(0.04 * i, speed);
}

// The camera looks along the body's x axis, 0.4 m before its origin.
Pose body_from_camera() {
  Pose pose = Pose::Identity();
  pose.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  pose.translation() = Eigen::Vector3d(0.4, 0.0, 0.6);
  return pose;
}

Value::List numbers(const Pose& pose) {
  const std::array<double, 7> v = numbers_of(pose);
  return Value::List(v.begin(), v.end());
}

Value::Map rig() {
  return {{"thermal_pose", numbers(body_from_camera())},
          {"lidar_pose", numbers(body_from_camera() * TestScene::extrinsics())}};
}

struct Drive {
  int frames = 50;
  bool calibrated = true;
  bool lidar = true;
  bool as_image = false;
  double prior_speed = 0.0;                                  // m/s; 0: no prior
  std::function<void(ThermalFrame&, int)> change = nullptr;  // of a frame before it is sent
  std::function<void(CameraInfo&)> change_camera = nullptr;

  std::vector<OfflineMessage> messages() const {
    std::vector<OfflineMessage> out;
    TestScene scene;
    const auto& camera = scene.camera;
    out.push_back(offline_message<Odometry>("/elsewhere", Time(begin), std::make_shared<const Odometry>()));
    if (calibrated) {
      auto info = std::make_shared<CameraInfo>();
      info->width = static_cast<std::uint32_t>(camera.width);
      info->height = static_cast<std::uint32_t>(camera.height);
      info->distortion_model = "plumb_bob";
      info->d = {0, 0, 0, 0, 0};
      info->k = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
      if (change_camera) change_camera(*info);
      out.push_back(offline_message<CameraInfo>("/camera_info", Time(begin), std::move(info)));
    }
    for (int i = 0; i < frames; ++i) {
      const Time stamp(begin + i * period);
      if (prior_speed > 0.0) {
        auto prior = std::make_shared<Odometry>();
        prior->header.stamp = to_stamp(stamp - 20ms);
        prior->pose.pose.position.x = prior_speed * (0.04 * i - 0.02);
        prior->pose.pose.orientation.w = 1.0;
        prior->twist.twist.linear.x = prior_speed;
        prior->twist.covariance[0] = 0.01;
        out.push_back(offline_message<Odometry>("/prior", stamp, std::move(prior)));
      }
      if (lidar && i % 3 == 0) {
        const auto scan = scene.scan(camera_at(i), 0);
        std::vector<LidarPoint> points;
        for (const Eigen::Vector3f& p : scan.points) points.push_back({p.x(), p.y(), p.z(), 1.0F, 0.0, 0});
        auto cloud = std::make_shared<PointCloud2>();
        cloud->header.stamp = to_stamp(stamp);
        EXPECT_TRUE(write_points(points, 1, PointLayout::xyzi, *cloud));
        out.push_back(offline_message<PointCloud2>("/points", stamp, std::move(cloud)));
      }
      const thermal_odometry::Frame rendered = scene.render(camera_at(i), 0);
      auto frame = std::make_shared<ThermalFrame>();
      frame->header.stamp = to_stamp(stamp);
      frame->header.frame_id = "thermal_optical";
      frame->width = static_cast<std::uint32_t>(rendered.width);
      frame->height = static_cast<std::uint32_t>(rendered.height);
      frame->step = 2 * frame->width;
      frame->significant_bits = 14;
      frame->frame_counter = static_cast<std::uint32_t>(i);
      frame->data.resize(std::size_t{frame->step} * frame->height);
      std::memcpy(frame->data.mutable_data(), rendered.data, frame->data.size());
      if (change) change(*frame, i);
      if (!as_image) {
        out.push_back(offline_message<ThermalFrame>("/frame", stamp, std::move(frame)));
        continue;
      }
      auto image = std::make_shared<Image>();
      image->header = frame->header;
      image->width = frame->width;
      image->height = frame->height;
      image->step = frame->step;
      image->encoding = "mono16";
      image->data = frame->data;
      out.push_back(offline_message<Image>("/image_raw", stamp, std::move(image)));
    }
    return out;
  }
};

struct Outcome {
  std::vector<Odometry> poses;
  std::vector<ThermalHealth> health;
  std::vector<Image> pictures;
  std::vector<std::byte> bytes;
  std::string reason;

  double error(int frame) const {
    const auto& p = poses.back().pose.pose.position;
    const Pose truth = camera_at(0).inverse() * camera_at(frame);
    return (Eigen::Vector3d(p.x, p.y, p.z) - truth.translation()).norm();
  }
};

Outcome run(const Drive& drive, Value::Map parameters = rig(), bool picture = false) {
  Outcome out;
  ComponentConfig config;
  config.type = config.name = "thermal_odometry";
  config.log_level = LogLevel::off;
  config.parameters = std::move(parameters);
  auto runner = OfflineRunner::build({config});
  EXPECT_TRUE(runner) << runner.error().message;
  if (!runner) return out;
  (*runner)->tap("/odometry", into(out.poses));
  (*runner)->tap("/health", into(out.health));
  if (picture) (*runner)->tap("/points_image", into(out.pictures));
  for (const char* topic : {"/odometry", "/health"}) {
    (*runner)->tap_cdr(topic, [&](Bytes cdr, Time) { out.bytes.insert(out.bytes.end(), cdr.begin(), cdr.end()); });
  }
  Recording recording(drive.messages());
  const auto stats = (*runner)->run(recording);
  EXPECT_TRUE(stats) << stats.error().message;
  for (const ComponentStatus& status : (*runner)->status()) out.reason = status.reason;
  return out;
}

bool finite(const Odometry& m) {
  double sum = m.pose.pose.position.x + m.pose.pose.orientation.w + m.twist.twist.linear.z + m.twist.twist.angular.x;
  for (const double c : m.pose.covariance) sum += c;
  for (const double c : m.twist.covariance) sum += c;
  return std::isfinite(sum) && m.pose.covariance[0] > 0.0;
}

TEST(ThermalOdometryComponent, MetricPosesWithTheirCovarianceAndHealth) {
  const Outcome out = run({});
  ASSERT_EQ(out.poses.size(), 50u);
  for (std::size_t i = 0; i < out.poses.size(); ++i) {
    const Odometry& m = out.poses[i];
    ASSERT_TRUE(finite(m)) << i;
    EXPECT_EQ(to_time(m.header.stamp), Time(begin + static_cast<int>(i) * period));
    EXPECT_EQ(m.header.frame_id, "thermal_odom");
    EXPECT_EQ(m.child_frame_id, "thermal_optical");
    if (i == 0) {
      EXPECT_GT(m.pose.covariance[0], 1e12);  // no step was measured
      continue;
    }
    EXPECT_LT(std::sqrt(m.pose.covariance[14]), 0.02);  // along the way
    EXPECT_LT(std::sqrt(m.pose.covariance[28]), 0.01);  // heading: about y
  }
  EXPECT_NEAR(out.poses.back().twist.twist.linear.z, speed, 0.1);
  EXPECT_LT(out.error(49), 0.005 * 0.04 * 49 * speed);
  ASSERT_EQ(out.health.size(), 50u);
  EXPECT_EQ(out.health.back().state, ThermalHealth::OK);
  EXPECT_EQ(out.health.back().flags, 0u);
  EXPECT_GT(out.health.back().active_points, 150u);
  EXPECT_GT(out.health.back().anchored_share, 0.5F);
  EXPECT_GT(out.health.back().weakest_information, 1e3);
  EXPECT_THAT(out.reason, HasSubstr("tracking: 49 of 50 frames measured"));
}

TEST(ThermalOdometryComponent, BitIdenticalFromRunToRun) {
  const Outcome out = run({.frames = 25});
  EXPECT_FALSE(out.bytes.empty());
  EXPECT_EQ(out.bytes, run({.frames = 25}).bytes);
}

TEST(ThermalOdometryComponent, AStockCameraDriversImagesServeAsWell) {
  const Outcome frames = run({.frames = 25});
  const Outcome images = run({.frames = 25, .as_image = true});
  ASSERT_EQ(images.poses.size(), frames.poses.size());
  EXPECT_EQ(images.poses.back().pose.pose.position, frames.poses.back().pose.pose.position);
}

TEST(ThermalOdometryComponent, TheStampIsTheMiddleOfTheReadoutLessTheLag) {
  const Outcome out = run({.frames = 10, .change = [](ThermalFrame& frame, int) {
                             frame.readout_time = 0.016F;
                             frame.integration_time = 0.010F;
                           }});
  ASSERT_FALSE(out.poses.empty());
  const Duration shift = to_time(out.poses.front().header.stamp) - Time(begin);
  EXPECT_NEAR(static_cast<double>(shift.count()), -2e6, 10.0);
}

TEST(ThermalOdometryComponent, WithoutTheLidarsPoseItSaysSoAndIsMonocular) {
  const Outcome out = run({}, {});
  EXPECT_THAT(out.reason, HasSubstr("17 clouds not used (the pose of the LiDAR is not given)"));
  EXPECT_THAT(out.reason, HasSubstr("scale arbitrary"));
  ASSERT_GT(out.poses.size(), 20u);
  EXPECT_NE(out.health.back().flags & ThermalHealth::FLAG_MONO_SCALE, 0u);
  // Speed is not known better than its own size; the heading is.
  const Odometry& last = out.poses.back();
  EXPECT_GT(std::sqrt(last.twist.covariance[14]), 0.9 * last.twist.twist.linear.z);
  EXPECT_LT(std::sqrt(last.pose.covariance[28]), 0.01);
  const Outcome own_scale = run({}, {{"scale_in_covariance", false}});
  EXPECT_LT(own_scale.poses.back().twist.covariance[14], 0.1 * last.twist.covariance[14]);
}

TEST(ThermalOdometryComponent, MissingAndWrongCalibrationIsStatedAndCounted) {
  const Outcome none = run({.frames = 5, .calibrated = false});
  EXPECT_TRUE(none.poses.empty());
  EXPECT_THAT(none.reason, HasSubstr("5 frames without calibration: no camera_info yet"));
  const Outcome fisheye =
      run({.frames = 5, .change_camera = [](CameraInfo& info) { info.distortion_model = "equidistant"; }});
  EXPECT_TRUE(fisheye.poses.empty());
  EXPECT_THAT(fisheye.reason, HasSubstr("'equidistant'"));
  const Outcome unfocused = run({.frames = 5, .change_camera = [](CameraInfo& info) { info.k[0] = 0.0; }});
  EXPECT_THAT(unfocused.reason, HasSubstr("focal length"));
  const Outcome given =
      run({.frames = 10, .calibrated = false},
          {{"camera_matrix", Value::List{210.0, 210.0, 159.5, 127.5}}, {"image_size", Value::List{320, 256}}});
  EXPECT_GT(given.health.size(), 8u);
}

TEST(ThermalOdometryComponent, BadFramesAreCountedAndSurvived) {
  const Outcome out = run({.frames = 40, .change = [](ThermalFrame& frame, int i) {
                             if (i == 20) frame.height = 200, frame.data.resize(std::size_t{frame.step} * 200);
                             if (i == 21) frame.data.resize(100);
                             if (i == 22) std::memset(frame.data.mutable_data(), 0, frame.data.size());
                             if (i > 22) frame.frame_counter += 2;
                           }});
  EXPECT_THAT(out.reason, HasSubstr("1 of another size"));
  EXPECT_THAT(out.reason, HasSubstr("1 uniform"));
  EXPECT_THAT(out.reason, HasSubstr("1 refused"));
  EXPECT_THAT(out.reason, HasSubstr("2 dropped by the camera"));
  EXPECT_EQ(out.poses.size(), 37u);
  EXPECT_LT(out.error(39), 0.03);
  const auto eight_bits = run({.frames = 5, .change = [](ThermalFrame& frame, int) {
                                 auto* bytes = frame.data.mutable_data();
                                 for (std::size_t i = 1; i < frame.data.size(); i += 2) bytes[i] = 0;
                               }});
  EXPECT_TRUE(eight_bits.poses.empty());
  EXPECT_THAT(eight_bits.reason, HasSubstr("5 of 8 bits"));
}

TEST(ThermalOdometryComponent, NothingIsPublishedWhileTheShutterIsClosed) {
  const Outcome out = run({.frames = 60, .change = [](ThermalFrame& frame, int i) {
                             if (i >= 30 && i < 42) frame.ffc_state = ThermalFrame::FFC_IN_PROGRESS;
                           }});
  EXPECT_EQ(out.poses.size(), 48u);
  for (const Odometry& m : out.poses) {
    const auto i = (to_time(m.header.stamp) - Time(begin)) / period;
    EXPECT_TRUE(i < 30 || i >= 42) << i;
  }
  EXPECT_EQ(std::count_if(out.health.begin(), out.health.end(),
                          [](const ThermalHealth& h) { return h.state == ThermalHealth::FROZEN; }),
            12);
  EXPECT_LT(out.error(59), 0.05);
}

TEST(ThermalOdometryComponent, APriorThatContradictsIsFlagged) {
  const auto flagged = [](const Outcome& out) {
    return std::count_if(out.health.begin(), out.health.end(),
                         [](const ThermalHealth& h) { return (h.flags & ThermalHealth::FLAG_PRIOR_DISAGREES) != 0; });
  };
  const Outcome right = run({.frames = 40, .prior_speed = speed});
  const Outcome wrong = run({.frames = 40, .prior_speed = 3.0 * speed});
  EXPECT_EQ(flagged(right), 0);
  EXPECT_GT(flagged(wrong), 30);
  EXPECT_LT(right.error(39), 0.03);
  EXPECT_LT(wrong.error(39), 0.03);  // a start, not a measurement
}

TEST(ThermalOdometryComponent, ThePictureShowsThePointsInColour) {
  const Outcome out = run({.frames = 12}, rig(), true);
  ASSERT_EQ(out.pictures.size(), 12u);
  const Image& picture = out.pictures.back();
  EXPECT_EQ(picture.encoding, "rgb8");
  ASSERT_EQ(picture.data.size(), 3u * 320u * 256u);
  int coloured = 0;
  for (std::size_t i = 0; i < picture.data.size(); i += 3) {
    coloured += picture.data.data()[i] != picture.data.data()[i + 1] ? 1 : 0;
  }
  EXPECT_GT(coloured, 1000);
  EXPECT_LT(coloured, 320 * 256 / 3);
}

}  // namespace
}  // namespace adit
