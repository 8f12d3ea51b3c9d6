// Between the library's structs and messages.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "components/thermal_odometry/estimate.hpp"
#include "components/thermal_odometry/frame.hpp"
#include "components/thermal_odometry/prior_motion.hpp"
#include "idl/point_cloud_view.hpp"
#include "idl/result.hpp"

namespace adit {
class ThermalFrameView;
namespace adit_msgs::msg {
struct ThermalHealth;
}
namespace builtin_interfaces::msg {
struct Time;
}
namespace nav_msgs::msg {
struct Odometry;
}
namespace sensor_msgs::msg {
struct CameraInfo;
struct PointCloud2;
}  // namespace sensor_msgs::msg
}  // namespace adit

namespace adit::thermal_odometry {

std::int64_t nanoseconds(const builtin_interfaces::msg::Time& stamp);

// As pose_from_numbers; no numbers: not known.
Result<std::optional<Pose>> pose_if_known(const std::vector<double>& numbers, const std::string& name);

// Errors: an unknown distortion model, a number of coefficients that does not fit, no size, no focal length.
Result<CameraModel> camera_of(const sensor_msgs::msg::CameraInfo& info);
Result<CameraModel> camera_of(const std::vector<double>& matrix, const std::vector<std::int64_t>& size,
                              const std::vector<double>& distortion);
bool same(const CameraModel& a, const CameraModel& b);

// Points `frame` to the message's pixels, or to a copy in `buffer` where their order or alignment forbids it.
void view_pixels(const ThermalFrameView& view, Frame& frame, std::vector<std::uint16_t>& buffer);

// A cloud as DepthPoints views it; reuses its memory.
struct CloudPoints {
  std::vector<Eigen::Vector3f> points;  // sensor frame [m]
  std::vector<float> seconds;           // after the message's stamp; empty: the message has no times
  // Errors: a message that is no cloud, or one without points.
  Result<void> read(const sensor_msgs::msg::PointCloud2& message);

 private:
  PointColumns columns_;
};

// From the axes of the right increment of `pose` to those of its parent frame, as messages have covariances.
Matrix6d about_parent_axes(const Pose& pose, const Matrix6d& covariance);

// Nothing if the pose is none.
std::optional<BodyMotion> body_motion_of(const nav_msgs::msg::Odometry& message);

// Pose, twist and covariances; not the header. `step_known`: the motion since the last published pose is measured; else
// its covariance is so large that it carries no information. The pose's covariance is about the axes of the odometry
// frame, as nav_msgs/Odometry has it, and that of the last alignment alone.
void fill(const Estimate& estimate, bool step_known, bool with_scale, nav_msgs::msg::Odometry& out);

// Everything but the header, the times and FLAG_FRAMES_DROPPED.
void fill(const Estimate& estimate, const Prior* prior, adit_msgs::msg::ThermalHealth& out);

}  // namespace adit::thermal_odometry
