// The code sample of the architecture document has to compile as it stands there, and to run.
#include <gtest/gtest.h>

#include "components/runtime/component.hpp"
#include "components/runtime/testing/harness.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit {
namespace {

using nav_msgs::msg::Odometry;
using PointCloud = sensor_msgs::msg::PointCloud2;

struct LidarOdometry {
  struct Config {
    double max_range = 0;
  } config;
};

class LidarOdometryComponent final : public Component {
  Param<double> max_range_{*this, "max_range", 100.0, Unit::metre, Range{1.0, 300.0}};
  Output<Odometry> odometry_{*this, "odometry", Qos::reliable(10)};
  Input<PointCloud> points_{*this, "points", Qos::sensor(), Queue{2, WhenFull::drop_oldest},
                            [this](const PointCloud& cloud, const MessageInfo& info) { on_cloud(cloud, info); }};
  LidarOdometry odometry_engine_;
  Result<void> configure() override;
  void on_cloud(const PointCloud&, const MessageInfo&);
};
ADIT_COMPONENT(LidarOdometryComponent, "test_lidar_odometry");

Result<void> LidarOdometryComponent::configure() {
  if (max_range_ < 2.0) return Error{ErrorCode::invalid_argument, "too short"};
  odometry_engine_.config.max_range = max_range_;
  return {};
}

void LidarOdometryComponent::on_cloud(const PointCloud& cloud, const MessageInfo&) {
  Odometry odometry;
  odometry.header = cloud.header;
  odometry.pose.pose.position.x = odometry_engine_.config.max_range;
  odometry_.publish(odometry);
}

struct Around final : Component {
  Output<PointCloud> points{*this, "points", Qos::sensor()};
  double x = 0;
  Input<Odometry> odometry{*this, "odometry", Qos::reliable(10),
                           [this](const Odometry& message, const MessageInfo&) { x = message.pose.pose.position.x; }};
};

TEST(AuthorSample, Runs) {
  testing::Harness harness;
  ComponentConfig config;
  config.parameters = Value::Map{{"max_range", 80.0}};
  harness.make<LidarOdometryComponent>("lidar_odometry", config);
  auto& around = harness.make<Around>("around");
  harness.start();
  around.points.publish(PointCloud{});
  harness.step();
  EXPECT_EQ(around.x, 80.0);
}

}  // namespace
}  // namespace adit
