#include "components/tunnel_simulator/sensor_messages.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "idl/point_cloud_writer.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/camera_info.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/imu.hpp"
#include "sensor_msgs/msg/nav_sat_fix.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace adit::tunnel_simulator {
namespace {

constexpr bool kBigEndian = std::endian::native == std::endian::big;

builtin_interfaces::msg::Time stamp_of(std::int64_t nanoseconds) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(std::chrono::nanoseconds(nanoseconds));
  builtin_interfaces::msg::Time stamp;
  stamp.sec = static_cast<std::int32_t>(seconds.count());
  stamp.nanosec = static_cast<std::uint32_t>((std::chrono::nanoseconds(nanoseconds) - seconds).count());
  return stamp;
}

std::int64_t first_row_ns(const Delivery& delivery, const Scenario& scenario) {
  const ThermalConfig& c = scenario.thermal;
  return delivery.stamp_ns - std::llround(0.5e9 * c.row_time * c.camera.height);
}

template <class Message>
void copy_pixels(const ThermalImage& image, Message& out) {
  out.height = static_cast<std::uint32_t>(image.height);
  out.width = static_cast<std::uint32_t>(image.width);
  out.step = out.width * 2;
  out.is_bigendian = kBigEndian;
  out.data.resize(image.counts.size() * sizeof(std::uint16_t));
  std::memcpy(out.data.mutable_data(), image.counts.data(), out.data.size());
}

}  // namespace

Result<void> fill(const LidarScan& scan, const Delivery& delivery, sensor_msgs::msg::PointCloud2& out) {
  constexpr float none = std::numeric_limits<float>::quiet_NaN();
  std::vector<LidarPoint> points(scan.points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool seen = scan.ranges[i] > 0.0F;
    const Eigen::Vector3f& p = scan.points[i];
    points[i] = {seen ? p.x() : none,    seen ? p.y() : none,
                 seen ? p.z() : none,    scan.reflectivity[i],
                 1e-9 * scan.time_ns[i], static_cast<std::uint16_t>(i / static_cast<std::size_t>(scan.columns))};
  }
  out.header.stamp = stamp_of(delivery.stamp_ns);
  out.header.frame_id = "lidar";
  return write_points(points, static_cast<std::uint32_t>(scan.rings), PointLayout::ouster, out);
}

void fill(const ThermalImage& image, const Delivery& delivery, const Scenario& scenario,
          adit_msgs::msg::ThermalFrame& out) {
  const ThermalConfig& c = scenario.thermal;
  out.header.stamp = stamp_of(first_row_ns(delivery, scenario));
  out.header.frame_id = "thermal_optical";
  copy_pixels(image, out);
  out.significant_bits = 14;
  out.radiometric_scale = static_cast<float>(1.0 / c.counts_per_kelvin);
  out.radiometric_offset =
      static_cast<float>(273.15 + scenario.world.temperatures.wall - c.counts_at_wall / c.counts_per_kelvin);
  out.ffc_state = image.ffc == FfcState::in_progress ? 2 : image.ffc == FfcState::complete ? 3 : 0;
  out.frames_since_ffc = static_cast<std::uint32_t>(image.since_ffc * c.rate);
  out.time_since_ffc = static_cast<float>(image.since_ffc);
  out.focal_plane_temperature = static_cast<float>(273.15 + image.focal_plane_celsius);
  out.integration_time = static_cast<float>(c.time_constant);
  out.readout_time = static_cast<float>(c.row_time * c.camera.height);
  if (!delivery.repeated) out.frame_counter = static_cast<std::uint32_t>(delivery.index);
}

void fill(const ThermalImage& image, const Delivery& delivery, const Scenario& scenario, sensor_msgs::msg::Image& out) {
  out.header.stamp = stamp_of(first_row_ns(delivery, scenario));
  out.header.frame_id = "thermal_optical";
  out.encoding = "mono16";
  copy_pixels(image, out);
}

void fill_camera_info(const Delivery& delivery, const Scenario& scenario, sensor_msgs::msg::CameraInfo& out) {
  const CameraModel& m = scenario.thermal.camera;
  out.header.stamp = stamp_of(first_row_ns(delivery, scenario));
  out.header.frame_id = "thermal_optical";
  out.height = static_cast<std::uint32_t>(m.height);
  out.width = static_cast<std::uint32_t>(m.width);
  out.distortion_model = "plumb_bob";
  out.d = {m.k1, m.k2, m.p1, m.p2, m.k3};
  out.k = {m.fx, 0, m.cx, 0, m.fy, m.cy, 0, 0, 1};
  out.r = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  out.p = {m.fx, 0, m.cx, 0, 0, m.fy, m.cy, 0, 0, 0, 1, 0};
}

void fill(const ImuSample& sample, const ImuConfig& config, sensor_msgs::msg::Imu& out) {
  out.header.stamp = stamp_of(sample.stamp_ns);
  out.header.frame_id = "imu";
  out.orientation_covariance[0] = -1.0;  // no orientation
  out.angular_velocity = {sample.rate.x(), sample.rate.y(), sample.rate.z()};
  out.linear_acceleration = {sample.acceleration.x(), sample.acceleration.y(), sample.acceleration.z()};
  for (std::size_t i = 0; i < 9; i += 4) {
    out.angular_velocity_covariance[i] = config.gyro_noise * config.gyro_noise * config.rate;
    out.linear_acceleration_covariance[i] = config.accel_noise * config.accel_noise * config.rate;
  }
}

void fill(const GnssSample& sample, sensor_msgs::msg::NavSatFix& out) {
  out.header.stamp = stamp_of(sample.stamp_ns);
  out.header.frame_id = "gnss";
  out.status.status = sample.fix == GnssFix::none ? -1 : sample.fix == GnssFix::single ? 0 : 2;
  out.status.service = 1;
  out.latitude = sample.latitude;
  out.longitude = sample.longitude;
  out.altitude = sample.altitude;
  out.position_covariance = {};
  const bool fixed = sample.fix != GnssFix::none;
  for (std::size_t i = 0; i < 3; ++i) {
    const double s = fixed ? sample.sigma[static_cast<Eigen::Index>(i)] : 0.0;
    out.position_covariance[4 * i] = s * s;
  }
  out.position_covariance_type = fixed ? 2 : 0;  // diagonal known
}

void fill_truth(const Simulation& simulation, double time, nav_msgs::msg::Odometry& out) {
  constexpr double h = 1e-3;
  const Pose pose = simulation.base(time);
  const double before = std::max(0.0, time - h);
  const Vector6d twist = se3_log(simulation.base(before).inverse() * simulation.base(time + h)) / (time + h - before);
  out.header.stamp = stamp_of(std::llround((simulation.scenario().epoch + time) * 1e9));
  out.header.frame_id = "map";
  out.child_frame_id = "base_link";
  const Eigen::Quaterniond q(pose.linear());
  out.pose.pose.position = {pose.translation().x(), pose.translation().y(), pose.translation().z()};
  out.pose.pose.orientation = {q.x(), q.y(), q.z(), q.w()};
  out.twist.twist.linear = {twist[0], twist[1], twist[2]};
  out.twist.twist.angular = {twist[3], twist[4], twist[5]};
}

void fill_rig(const Scenario& scenario, tf2_msgs::msg::TFMessage& out) {
  out.transforms.resize(3);
  const Pose* poses[] = {&scenario.rig.lidar, &scenario.rig.thermal, &scenario.rig.imu};
  const char* names[] = {"lidar", "thermal_optical", "imu"};
  for (std::size_t i = 0; i < 3; ++i) {
    auto& t = out.transforms[i];
    const Eigen::Quaterniond q(poses[i]->linear());
    const Eigen::Vector3d p = poses[i]->translation();
    t.header.stamp = stamp_of(std::llround(scenario.epoch * 1e9));
    t.header.frame_id = "base_link";
    t.child_frame_id = names[i];
    t.transform.translation = {p.x(), p.y(), p.z()};
    t.transform.rotation = {q.x(), q.y(), q.z(), q.w()};
  }
}

}  // namespace adit::tunnel_simulator
