// Samples of the simulator as messages. Each fill() replaces the whole message and reuses its memory.
#pragma once

#include <string>

#include "components/tunnel_simulator/simulation.hpp"

namespace adit::sensor_msgs::msg {
struct CameraInfo;
struct Image;
struct Imu;
struct NavSatFix;
struct PointCloud2;
}  // namespace adit::sensor_msgs::msg
namespace adit::adit_msgs::msg {
struct ThermalFrame;
}
namespace adit::nav_msgs::msg {
struct Odometry;
}
namespace adit::tf2_msgs::msg {
struct TFMessage;
}

namespace adit::tunnel_simulator {

// Ouster's field layout, organized: one row a ring; missing returns are NaN.
Result<void> fill(const LidarScan& scan, const Delivery& delivery, sensor_msgs::msg::PointCloud2& out);
// Header stamp: the first row, as adit_msgs/ThermalFrame wants it (delivery.stamp_ns is the middle of the readout).
void fill(const ThermalImage& image, const Delivery& delivery, const Scenario& scenario,
          adit_msgs::msg::ThermalFrame& out);
void fill(const ThermalImage& image, const Delivery& delivery, const Scenario& scenario, sensor_msgs::msg::Image& out);
void fill_camera_info(const Delivery& delivery, const Scenario& scenario, sensor_msgs::msg::CameraInfo& out);
void fill(const ImuSample& sample, const ImuConfig& config, sensor_msgs::msg::Imu& out);
void fill(const GnssSample& sample, sensor_msgs::msg::NavSatFix& out);
// map -> base_link with the exact twist in the body frame, at a time since the start [s].
void fill_truth(const Simulation& simulation, double time, nav_msgs::msg::Odometry& out);
// base_link -> lidar, thermal_optical, imu.
void fill_rig(const Scenario& scenario, tf2_msgs::msg::TFMessage& out);

}  // namespace adit::tunnel_simulator
