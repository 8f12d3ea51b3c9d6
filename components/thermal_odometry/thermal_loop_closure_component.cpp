#include <algorithm>
#include <optional>
#include <string>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"
#include "components/thermal_odometry/component_messages.hpp"
#include "components/thermal_odometry/loop_closure.hpp"
#include "components/thermal_odometry/loop_input.hpp"
#include "geometry_msgs/msg/pose_with_covariance_stamped.hpp"
#include "idl/thermal_frame_view.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/camera_info.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace adit {
namespace {

using adit_msgs::msg::ThermalFrame;
using geometry_msgs::msg::PoseWithCovarianceStamped;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::CameraInfo;
using sensor_msgs::msg::PointCloud2;
using tf2_msgs::msg::TFMessage;
using thermal_odometry::LoopClosure;
using thermal_odometry::LoopInput;

// Beside thermal_odometry, on the same frames and clouds: its poses in, a correction out.
class ThermalLoopClosureComponent final : public Component {
  using Numbers = std::vector<double>;

  Param<bool> enabled_{*this, "enabled", false,
                       "look for places met again: not in tunnels, which look alike everywhere"};
  Param<double> distance_{*this,       "keyframe_distance", 2.0,
                          Unit::metre, Range{0.1, 100.0},   "from one keyframe to the next"};
  Param<double> min_path_{*this,       "min_path",      15.0,
                          Unit::metre, Range{0.0, 1e5}, "driven before a place can be met again"};
  Param<std::int64_t> min_inliers_{*this, "min_inliers", 15, Range{6, 1000}, "corners that agree on a motion"};
  Param<std::int64_t> max_keyframes_{*this, "max_keyframes", 3000, Range{2, 100'000},
                                     "of the map; then it is full (60 kB each that is a new place)"};
  Param<Numbers> camera_matrix_{*this, "camera_matrix", {}, "fx fy cx cy [px]; empty: from camera_info"};
  Param<std::vector<std::int64_t>> image_size_{*this, "image_size", {}, "width and height, with camera_matrix"};
  Param<Numbers> distortion_{*this, "distortion", {}, "k1 k2 p1 p2 [k3 [k4 k5 k6]], with camera_matrix"};
  Param<Numbers> thermal_pose_{*this, "thermal_pose", {}, "of the camera in base_frame: x y z [m], quaternion x y z w"};
  Param<Numbers> lidar_pose_{*this, "lidar_pose", {}, "of the LiDAR in base_frame"};
  Param<std::string> map_frame_{*this, "map_frame", std::string("thermal_map"), "of what is published"};

  // Where the camera is in the map, at each closure: camera axes, pose of the camera, covariance to the first keyframe.
  Output<PoseWithCovarianceStamped> closure_{*this, "closure", Qos::reliable(10)};
  Output<TFMessage> correction_{*this, "correction", Qos::reliable(10)};  // map_frame -> the odometry's frame
  Input<CameraInfo> camera_info_{*this, "camera_info", Qos::sensor(), Queue{2, WhenFull::drop_oldest},
                                 [this](const CameraInfo& info, const MessageInfo&) { on_camera_info(info); }};
  Input<PointCloud2> points_{*this, "points", Qos::sensor(), Queue{2, WhenFull::drop_oldest},
                             [this](const PointCloud2& cloud, const MessageInfo&) { on_cloud(cloud); }};
  Input<ThermalFrame> frame_{*this, "frame", Qos::sensor(), Queue{4, WhenFull::drop_oldest},
                             [this](const ThermalFrame& frame, const MessageInfo&) { on_frame(frame); }};
  Input<Odometry> odometry_{*this, "odometry", Qos::reliable(10), Queue{10, WhenFull::drop_oldest},
                            [this](const Odometry& message, const MessageInfo&) { on_odometry(message); }};

  std::optional<thermal_odometry::CameraModel> camera_;
  Pose camera_from_lidar_ = Pose::Identity();
  std::optional<LoopInput> input_;
  std::optional<LoopClosure> loops_;
  std::string trouble_;
  std::vector<std::uint16_t> pixels_;
  thermal_odometry::CloudPoints cloud_;

  Result<void> configure() override;
  Result<void> activate() override;
  void on_camera_info(const CameraInfo& info);
  void on_cloud(const PointCloud2& message);
  void on_frame(const ThermalFrame& message);
  void on_odometry(const Odometry& message);
  void start();
  void publish(const LoopClosure::Outcome& outcome, const Odometry& odometry);
  void report();
};

Result<void> ThermalLoopClosureComponent::configure() {
  camera_.reset();
  if (!enabled_) return {};
  const Result<std::optional<Pose>> thermal = thermal_odometry::pose_if_known(thermal_pose_, "thermal_pose");
  const Result<std::optional<Pose>> lidar = thermal_odometry::pose_if_known(lidar_pose_, "lidar_pose");
  if (!thermal) return thermal.error();
  if (!lidar) return lidar.error();
  if (!*thermal || !*lidar) {
    return Error{ErrorCode::invalid_argument, "thermal_pose and lidar_pose are needed: places are verified by depth"};
  }
  camera_from_lidar_ = (*thermal)->inverse() * **lidar;
  if (camera_matrix_.value().empty()) return {};
  const auto camera = thermal_odometry::camera_of(camera_matrix_, image_size_, distortion_);
  if (!camera) return camera.error();
  camera_ = *camera;
  return {};
}

Result<void> ThermalLoopClosureComponent::activate() {
  trouble_.clear();
  start();
  report();
  return {};
}

void ThermalLoopClosureComponent::start() {
  input_.reset();
  loops_.reset();
  if (!enabled_ || !camera_) return;
  LoopInput::Config input;
  input.distance = distance_;
  input_.emplace(*camera_, input);
  LoopClosure::Config config;
  config.min_path = min_path_;
  config.min_inliers = static_cast<int>(min_inliers_.value());
  config.max_keyframes = static_cast<std::size_t>(max_keyframes_.value());
  loops_.emplace(thermal_odometry::pinhole_of(*camera_), config);
}

void ThermalLoopClosureComponent::on_camera_info(const CameraInfo& info) {
  if (!enabled_ || !camera_matrix_.value().empty()) return;
  const auto camera = thermal_odometry::camera_of(info);
  if (!camera) {
    trouble_ = "camera_info: " + camera.error().message;
    return report();
  }
  if (camera_ && thermal_odometry::same(*camera, *camera_)) return;
  camera_ = *camera;
  start();
}

void ThermalLoopClosureComponent::on_cloud(const PointCloud2& message) {
  if (!input_) return;
  if (const Result<void> read = cloud_.read(message); !read) {
    trouble_ = read.error().message;
    return;
  }
  input_->add_cloud(
      {cloud_.points, cloud_.seconds, thermal_odometry::nanoseconds(message.header.stamp), camera_from_lidar_});
}

void ThermalLoopClosureComponent::on_frame(const ThermalFrame& message) {
  if (!input_) return;
  const Result<ThermalFrameView> view = ThermalFrameView::of(message);
  if (!view) return;  // thermal_odometry says so
  thermal_odometry::Frame frame;
  frame.width = static_cast<int>(view->width());
  frame.height = static_cast<int>(view->height());
  frame.stamp_ns = thermal_odometry::nanoseconds(message.header.stamp);
  thermal_odometry::view_pixels(*view, frame, pixels_);
  input_->add_frame(frame);
}

void ThermalLoopClosureComponent::on_odometry(const Odometry& message) {
  if (!input_) return;
  const auto motion = thermal_odometry::body_motion_of(message);
  if (!motion) return;
  constexpr double no_information = 1e6;  // m^2: thermal_odometry's word for a step that nobody measured
  const bool known = message.pose.covariance[0] < no_information;
  if (!input_->add_pose(motion->stamp_ns, motion->pose, known)) return;
  const LoopClosure::Outcome& outcome =
      loops_->add(motion->pose, input_->known(), input_->corners(), input_->descriptors());
  if (outcome.result == LoopClosure::Result::closed) publish(outcome, message);
  report();
}

void ThermalLoopClosureComponent::publish(const LoopClosure::Outcome& outcome, const Odometry& odometry) {
  const Pose in_map = loops_->graph().pose(outcome.node);
  Loan<PoseWithCovarianceStamped> closure = closure_.loan();
  closure->header = odometry.header;
  closure->header.frame_id = map_frame_.value();
  const Eigen::Quaterniond q(in_map.linear());
  closure->pose.pose.position = {in_map.translation().x(), in_map.translation().y(), in_map.translation().z()};
  closure->pose.pose.orientation = {q.x(), q.y(), q.z(), q.w()};
  if (const auto relative = loops_->graph().relative(0, outcome.node)) {
    const Matrix6d covariance = thermal_odometry::about_parent_axes(in_map, relative->covariance);
    std::copy_n(covariance.data(), covariance.size(), closure->pose.covariance.begin());
  }
  closure_.publish(std::move(closure));

  const Pose& moved = loops_->T_map_odom();
  const Eigen::Quaterniond r(moved.linear());
  Loan<TFMessage> correction = correction_.loan();
  correction->transforms.resize(1);
  auto& transform = correction->transforms[0];
  transform.header = odometry.header;
  transform.header.frame_id = map_frame_.value();
  transform.child_frame_id = odometry.header.frame_id;
  transform.transform.translation = {moved.translation().x(), moved.translation().y(), moved.translation().z()};
  transform.transform.rotation = {r.x(), r.y(), r.z(), r.w()};
  correction_.publish(std::move(correction));
}

void ThermalLoopClosureComponent::report() {
  if (!enabled_) return health(Health::ok, "off");
  if (!loops_) return health(Health::warn, trouble_.empty() ? "no camera_info yet" : trouble_);
  const auto count = [this](LoopClosure::Result result) { return std::to_string(loops_->count(result)); };
  const bool full = loops_->count(LoopClosure::Result::full) > 0;
  health(full ? Health::warn : Health::ok,
         std::to_string(loops_->graph().size()) + (full ? " keyframes (full), " : " keyframes, ") +
             count(LoopClosure::Result::closed) + " closures, " + count(LoopClosure::Result::out_of_reach) +
             " out of reach, " + count(LoopClosure::Result::not_verified) + " not verified, " +
             count(LoopClosure::Result::refused) + " refused" + (trouble_.empty() ? "" : " (" + trouble_ + ")"));
}

ADIT_COMPONENT(ThermalLoopClosureComponent, "thermal_loop_closure");

}  // namespace
}  // namespace adit
