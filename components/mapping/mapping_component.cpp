#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>

#include <Eigen/Eigenvalues>

#include "components/geometry/rigid.hpp"
#include "components/mapping/map_file.hpp"
#include "components/mapping/mapper.hpp"
#include "components/mapping/sweep_buffer.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"
#include "geometry_msgs/msg/transform_stamped.hpp"
#include "idl/point_cloud_view.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace adit {
namespace {

using geometry_msgs::msg::TransformStamped;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::PointCloud2;
using sensor_msgs::msg::PointField;
using tf2_msgs::msg::TFMessage;

// Whose poses the odometry has. body: the frame that lidar_pose mounts the LiDAR in. sensor: the LiDAR's own, in its
// frame at the start; map and odom are then those of the body all the same.
enum class OdometryOf { body, sensor };

class MappingComponent final : public Component {
  Param<OdometryOf> odometry_of_{*this, "odometry_of", OdometryOf::sensor,
                                 Choices<OdometryOf>{{"body", OdometryOf::body}, {"sensor", OdometryOf::sensor}},
                                 "whose poses `odometry` has"};
  Param<std::vector<double>> lidar_pose_{*this, "lidar_pose", std::vector<double>{0, 0, 0, 0, 0, 0, 1},
                                         "of the LiDAR on the body: x y z [m], quaternion x y z w"};
  Param<double> keyframe_distance_{*this, "keyframe_distance", 4.0, Unit::metre, Range{0.5, 50.0}, "between keyframes"};
  Param<std::int64_t> max_keyframes_{*this, "max_keyframes", 4000, Range{10.0, 1e6},
                                     "then the map grows no more; one of 4 m of tunnel takes up to 130 kB"};
  Param<double> min_range_{*this, "min_range", 1.0, Unit::metre, Range{0.0, 100.0}, "nearer points are dropped"};
  Param<double> max_range_{*this, "max_range", 60.0, Unit::metre, Range{1.0, 500.0}, "farther points are dropped"};
  Param<double> drift_translation_{
      *this,       "drift_translation", 0.02,
      Unit::metre, Range{1e-4, 10.0},   "of the odometry, one sigma of 1 m of way (of d m: times sqrt(d))"};
  Param<double> drift_rotation_{*this, "drift_rotation", 0.00035, Unit::radian, Range{1e-6, 1.0}, "the same"};
  Param<double> degenerate_sigma_{*this,
                                  "degenerate_sigma",
                                  1.0,
                                  Unit::metre,
                                  Range{0.0, 1e6},
                                  "an odometry message with a larger one sigma along some axis did not observe that "
                                  "axis; 0: its covariance is not looked at"};
  Param<double> map_voxel_{*this, "map_voxel", 0.3, Unit::metre, Range{0.05, 10.0}, "of the published and written map"};
  Param<double> map_period_{*this,
                            "map_period",
                            2.0,
                            Unit::second,
                            Range{0.1, 3600.0},
                            "maps are published at most so often, and only when they changed and somebody listens"};
  Param<std::string> map_frame_{*this, "map_frame", std::string("map"), "frame of the map"};
  Param<std::string> base_frame_{*this, "base_frame", std::string("base_link"), "frame of the body, of `pose`"};
  Param<std::string> map_file_{*this, "map_file", std::string(), "written when the component stops: .pcd or .ply"};
  Param<std::string> trajectory_file_{*this, "trajectory_file", std::string(),
                                      "the keyframes' poses in the map (TUM), written when the component stops"};

  Output<TransformStamped> map_odom_{*this, "map_odom", Qos::latched(1)};
  Output<TFMessage> tf_{*this, "tf", Qos::tf()};
  Output<Odometry> pose_{*this, "pose", Qos::reliable(10)};
  Output<PointCloud2> map_{*this, "map", Qos::latched(1)};
  Output<PointCloud2> local_map_{*this, "local_map", Qos::latched(1)};
  Input<PointCloud2> points_{*this, "points", Qos::sensor(), Queue{4, WhenFull::drop_oldest},
                             [this](const PointCloud2& cloud, const MessageInfo&) { on_cloud(cloud); }};
  Input<Odometry> odometry_{*this, "odometry", Qos::reliable(100), Queue{100, WhenFull::drop_oldest},
                            [this](const Odometry& message, const MessageInfo&) { on_odometry(message); }};
  Timer publishing_{*this, "publishing", std::chrono::seconds(2), [this] { publish_maps(); }};

  mapping::Config config_;
  std::optional<mapping::Mapper> mapper_;
  mapping::SweepBuffer buffer_;
  Pose body_from_sensor_ = Pose::Identity();
  std::string odom_frame_ = "odom";
  Eigen::Vector3d unobserved_ = Eigen::Vector3d::Zero();  // by the last odometry message
  std::uint64_t refused_clouds_ = 0, refused_poses_ = 0, dropped_sweeps_ = 0;
  bool map_changed_ = false, local_changed_ = false;

  Result<void> configure() override;
  Result<void> activate() override;
  Result<void> deactivate() override;
  void on_time_jump(Duration) override;
  void on_cloud(const PointCloud2& message);
  void on_odometry(const Odometry& message);
  void process();
  void publish_correction(Time stamp);
  void publish_pose(const Odometry& message);
  void publish_maps();
  void publish_points(Output<PointCloud2>& output, const mapping::Points& points);
  void report();
};

Result<void> MappingComponent::configure() {
  const Result<Pose> sensor = pose_from_numbers(lidar_pose_.value(), "lidar_pose");
  if (!sensor) return sensor.error();
  body_from_sensor_ = *sensor;
  const std::string& file = map_file_.value();
  if (!file.empty() && !file.ends_with(".pcd") && !file.ends_with(".ply")) {
    return Error{ErrorCode::invalid_argument, "map_file: " + file + " ends neither in .pcd nor in .ply"};
  }
  for (const std::string& path : {file, trajectory_file_.value()}) {
    std::error_code ignored;  // writing says what is wrong
    if (const auto folder = std::filesystem::path(path).parent_path(); !folder.empty()) {
      std::filesystem::create_directories(folder, ignored);
    }
  }
  config_ = {};
  config_.keyframes.distance = keyframe_distance_;
  config_.keyframes.sweep.min_range = min_range_;
  config_.keyframes.sweep.max_range = max_range_;
  config_.max_keyframes = static_cast<std::size_t>(max_keyframes_.value());
  config_.drift_translation = drift_translation_;
  config_.drift_rotation = drift_rotation_;
  publishing_.set_period(std::chrono::duration_cast<Duration>(std::chrono::duration<double>(map_period_.value())));
  return {};
}

Result<void> MappingComponent::activate() {
  on_time_jump({});
  refused_clouds_ = refused_poses_ = dropped_sweeps_ = 0;
  return {};
}

Result<void> MappingComponent::deactivate() {
  if (mapper_->finish()) map_changed_ = true;
  publish_maps();
  report();
  if (!map_file_.value().empty()) {
    if (auto written = mapping::write_map(map_file_, mapper_->global_map(map_voxel_)); !written) return written;
  }
  if (!trajectory_file_.value().empty()) {
    if (auto written = write_tum(trajectory_file_, mapper_->trajectory()); !written) return written;
  }
  return {};
}

// The recording began anew: so does the map.
void MappingComponent::on_time_jump(Duration) {
  mapper_.emplace(config_);
  buffer_.clear();
  unobserved_.setZero();
  map_changed_ = local_changed_ = false;
}

void MappingComponent::on_cloud(const PointCloud2& message) {
  const Result<PointCloudView> view = PointCloudView::of(message);
  if (!view) {
    ++refused_clouds_;
    health(Health::warn, std::to_string(refused_clouds_) + " clouds refused: " + view.error().message);
    return;
  }
  mapping::OwnedSweep sweep;
  sweep.stamp_ns = to_time(message.header.stamp).time_since_epoch().count();
  sweep.unobserved = unobserved_;
  const std::size_t step = mapping::odd_stride(view->size(), config_.keyframes.sweep.most_points);
  sweep.points.reserve(view->size() / step + 1);
  for (std::size_t i = 0; i < view->size(); i += step) {
    const std::array<float, 3> p = view->position(i);
    sweep.points.push_back({{p[0], p[1], p[2]}, view->has_intensity() ? view->intensity(i) : 0.0F});
    if (view->has_time()) sweep.seconds.push_back(static_cast<float>(view->time(i)));
  }
  if (buffer_.add(std::move(sweep))) ++dropped_sweeps_;
  process();
}

void MappingComponent::on_odometry(const Odometry& message) {
  const auto& p = message.pose.pose.position;
  const auto& o = message.pose.pose.orientation;
  const Eigen::Quaterniond q(o.w, o.x, o.y, o.z);
  StampedPose pose;
  pose.stamp_ns = to_time(message.header.stamp).time_since_epoch().count();
  pose.pose.translation() = Eigen::Vector3d(p.x, p.y, p.z);
  pose.pose.linear() = q.normalized().toRotationMatrix();
  const Pose moved = pose.pose;
  pose.pose = odometry_of_ == OdometryOf::body ? moved * body_from_sensor_ : body_from_sensor_ * moved;
  if (!(std::abs(q.norm() - 1.0) < 0.01) || !buffer_.add(pose)) {
    ++refused_poses_;
    report();
    return;
  }
  odom_frame_ = message.header.frame_id;
  unobserved_.setZero();
  Eigen::Matrix3d covariance;  // of the position, about the axes of odom
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) covariance(r, c) = message.pose.covariance[static_cast<std::size_t>(6 * r + c)];
  }
  if (degenerate_sigma_ > 0.0 && covariance.allFinite()) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
    if (std::sqrt(std::max(0.0, solver.eigenvalues()[2])) > degenerate_sigma_) {
      unobserved_ = moved.linear().transpose() * solver.eigenvectors().col(2);
      if (odometry_of_ == OdometryOf::body) unobserved_ = body_from_sensor_.linear().transpose() * unobserved_;
    }
  }
  process();
  publish_correction(to_time(message.header.stamp));
  if (pose_.has_readers()) publish_pose(message);
}

void MappingComponent::process() {
  bool keyframe = false;
  while (const std::optional<mapping::OwnedSweep> sweep = buffer_.next()) {
    const mapping::Mapper::Update update = mapper_->add(sweep->view(), buffer_.poses(), sweep->unobserved);
    local_changed_ = local_changed_ || update.used;
    keyframe = keyframe || update.keyframe || !update.used;
    map_changed_ = map_changed_ || update.keyframe || update.moved;
  }
  if (keyframe) report();
}

void MappingComponent::publish_correction(Time stamp) {
  Loan<TransformStamped> message = map_odom_.loan();
  message->header.stamp = to_stamp(stamp);
  message->header.frame_id = map_frame_.value();
  message->child_frame_id = odom_frame_;
  const Pose map_odom = mapper_->map_odom();
  const Eigen::Vector3d t = map_odom.translation();
  const Eigen::Quaterniond q(map_odom.linear());
  message->transform.translation = {t.x(), t.y(), t.z()};
  message->transform.rotation = {q.x(), q.y(), q.z(), q.w()};
  if (tf_.has_readers()) {
    Loan<TFMessage> tf = tf_.loan();
    tf->transforms.assign(1, *message);
    tf_.publish(std::move(tf));
  }
  map_odom_.publish(std::move(message));
}

// The body's pose where the odometry has just put it, corrected.
void MappingComponent::publish_pose(const Odometry& message) {
  Loan<Odometry> out = pose_.loan();
  *out = message;
  out->header.frame_id = map_frame_.value();
  out->child_frame_id = base_frame_.value();
  const Pose corrected = mapper_->map_odom() * buffer_.poses().back().pose * body_from_sensor_.inverse();
  const Eigen::Vector3d t = corrected.translation();
  const Eigen::Quaterniond q(corrected.linear());
  out->pose.pose.position = {t.x(), t.y(), t.z()};
  out->pose.pose.orientation = {q.x(), q.y(), q.z(), q.w()};
  pose_.publish(std::move(out));
}

void MappingComponent::publish_maps() {
  if (map_changed_ && map_.has_readers()) {
    publish_points(map_, mapper_->global_map(map_voxel_));
    map_changed_ = false;
  }
  if (local_changed_ && local_map_.has_readers()) {
    publish_points(local_map_, mapper_->local_map());
    local_changed_ = false;
  }
}

void MappingComponent::publish_points(Output<PointCloud2>& output, const mapping::Points& points) {
  static_assert(sizeof(mapping::Point) == 4 * sizeof(float));
  Loan<PointCloud2> message = output.loan();
  message->header.stamp = to_stamp(clock().now());
  message->header.frame_id = map_frame_.value();
  message->height = 1;
  message->width = static_cast<std::uint32_t>(points.size());
  message->fields.clear();
  for (const char* name : {"x", "y", "z", "intensity"}) {
    const auto offset = static_cast<std::uint32_t>(message->fields.size() * sizeof(float));
    message->fields.push_back({.name = name, .offset = offset, .datatype = PointField::FLOAT32, .count = 1});
  }
  message->is_bigendian = false;
  message->point_step = sizeof(mapping::Point);
  message->row_step = message->point_step * message->width;
  message->is_dense = true;
  message->data.resize(message->row_step);
  std::memcpy(message->data.mutable_data(), points.data(), message->row_step);
  output.publish(std::move(message));
}

void MappingComponent::report() {
  const mapping::Counters& c = mapper_->counters();
  const bool full = c.keyframes_refused > 0;
  std::string text =
      std::to_string(mapper_->graph().size()) + " keyframes, " + std::to_string(c.closures) + " closures";
  if (c.switched_off > 0) text += " (" + std::to_string(c.switched_off) + " switched off)";
  if (full) text += ", full: max_keyframes";
  const std::uint64_t refused = refused_clouds_ + c.refused_sweeps + dropped_sweeps_;
  if (refused > 0) text += ", " + std::to_string(refused) + " sweeps without odometry or points";
  if (refused_poses_ > 0) text += ", " + std::to_string(refused_poses_) + " poses refused";
  health(full ? Health::warn : Health::ok, std::move(text));
}

ADIT_COMPONENT(MappingComponent, "mapping");

}  // namespace
}  // namespace adit
