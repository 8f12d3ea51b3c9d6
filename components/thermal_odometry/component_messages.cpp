#include "components/thermal_odometry/component_messages.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "adit_msgs/msg/thermal_health.hpp"
#include "components/geometry/rigid.hpp"
#include "components/runtime/stamp.hpp"
#include "components/thermal_odometry/camera.hpp"
#include "idl/thermal_frame_view.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/camera_info.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit::thermal_odometry {
namespace {

constexpr double no_information = 1e13;  // variance

Result<void> set_distortion(std::span<const double> d, CameraModel& camera) {
  if (d.empty()) return {};
  if (d.size() != 4 && d.size() != 5 && d.size() != 8) {
    return Error{ErrorCode::invalid_argument,
                 std::to_string(d.size()) + " distortion coefficients: 0, 4, 5 or 8 are wanted"};
  }
  camera.distortion = d.size() == 8 ? Distortion::rational : Distortion::plumb_bob;
  std::copy(d.begin(), d.end(), camera.coefficients.begin());
  return {};
}

}  // namespace

Matrix6d about_parent_axes(const Pose& pose, const Matrix6d& covariance) {
  Matrix6d rotation = Matrix6d::Zero();
  rotation.topLeftCorner<3, 3>() = rotation.bottomRightCorner<3, 3>() = pose.linear();
  const Matrix6d rotated = rotation * covariance * rotation.transpose();
  return 0.5 * (rotated + rotated.transpose());
}

std::int64_t nanoseconds(const builtin_interfaces::msg::Time& stamp) {
  return to_time(stamp).time_since_epoch().count();
}

Result<std::optional<Pose>> pose_if_known(const std::vector<double>& numbers, const std::string& name) {
  if (numbers.empty()) return std::optional<Pose>();
  const Result<Pose> pose = pose_from_numbers(numbers, name);
  if (!pose) return pose.error();
  return std::optional<Pose>(*pose);
}

Result<CameraModel> camera_of(const sensor_msgs::msg::CameraInfo& info) {
  CameraModel camera;
  if (info.width > 4096 || info.height > 4096) {
    return Error{ErrorCode::invalid_argument,
                 "size " + std::to_string(info.width) + " x " + std::to_string(info.height)};
  }
  camera.width = static_cast<int>(info.width);
  camera.height = static_cast<int>(info.height);
  camera.fx = info.k[0];
  camera.cx = info.k[2];
  camera.fy = info.k[4];
  camera.cy = info.k[5];
  const std::string& model = info.distortion_model;
  if (!info.d.empty() && !model.empty() && model != "plumb_bob" && model != "rational_polynomial") {
    return Error{ErrorCode::invalid_argument,
                 "distortion model '" + model + "' is not plumb_bob or rational_polynomial"};
  }
  if (Result<void> set = set_distortion(info.d, camera); !set) return set.error();
  if (Result<void> valid = check(camera); !valid) return valid.error();
  return camera;
}

Result<CameraModel> camera_of(const std::vector<double>& matrix, const std::vector<std::int64_t>& size,
                              const std::vector<double>& distortion) {
  if (matrix.size() != 4) return Error{ErrorCode::invalid_argument, "camera_matrix: 4 numbers are wanted: fx fy cx cy"};
  if (size.size() != 2 || std::min(size[0], size[1]) < 1 || std::max(size[0], size[1]) > 4096) {
    return Error{ErrorCode::invalid_argument, "image_size: width and height are wanted beside camera_matrix"};
  }
  CameraModel camera;
  camera.width = static_cast<int>(size[0]);
  camera.height = static_cast<int>(size[1]);
  camera.fx = matrix[0];
  camera.fy = matrix[1];
  camera.cx = matrix[2];
  camera.cy = matrix[3];
  if (Result<void> set = set_distortion(distortion, camera); !set) return set.error();
  if (Result<void> valid = check(camera); !valid) return valid.error();
  return camera;
}

bool same(const CameraModel& a, const CameraModel& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy &&
         a.distortion == b.distortion && a.coefficients == b.coefficients;
}

void view_pixels(const ThermalFrameView& view, Frame& frame, std::vector<std::uint16_t>& buffer) {
  const auto first = view.direct_row(0);
  const auto last = view.direct_row(view.height() - 1);
  const std::ptrdiff_t rows = static_cast<std::ptrdiff_t>(view.height()) - 1;
  if (!first.empty() && !last.empty() && (rows == 0 || (last.data() - first.data()) % rows == 0)) {
    frame.data = first.data();
    frame.stride = rows > 0 ? static_cast<int>((last.data() - first.data()) / rows) : frame.width;
    return;
  }
  buffer.resize(view.size());
  view.copy_to(buffer);
  frame.data = buffer.data();
  frame.stride = frame.width;
}

Result<void> CloudPoints::read(const sensor_msgs::msg::PointCloud2& message) {
  const Result<PointCloudView> view = PointCloudView::of(message);
  if (!view) return view.error();
  view->copy_to(columns_);
  if (columns_.x.empty()) return Error{ErrorCode::malformed, "a cloud without points"};
  points.resize(columns_.x.size());
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = {columns_.x[i], columns_.y[i], columns_.z[i]};
  seconds.assign(columns_.time.begin(), columns_.time.end());
  return {};
}

std::optional<BodyMotion> body_motion_of(const nav_msgs::msg::Odometry& message) {
  const auto& p = message.pose.pose.position;
  const auto& q = message.pose.pose.orientation;
  const Eigen::Quaterniond rotation(q.w, q.x, q.y, q.z);
  if (!(std::abs(rotation.norm() - 1.0) < 0.01)) return std::nullopt;
  BodyMotion motion;
  motion.stamp_ns = nanoseconds(message.header.stamp);
  motion.pose.translation() = Eigen::Vector3d(p.x, p.y, p.z);
  motion.pose.linear() = rotation.normalized().toRotationMatrix();
  const auto& v = message.twist.twist.linear;
  const auto& w = message.twist.twist.angular;
  motion.twist << v.x, v.y, v.z, w.x, w.y, w.z;
  for (int i = 0; i < 6; ++i) motion.twist_variance[i] = message.twist.covariance[static_cast<std::size_t>(7 * i)];
  return motion;
}

void fill(const Estimate& estimate, bool step_known, bool with_scale, nav_msgs::msg::Odometry& out) {
  const Pose& pose = estimate.T_odom_camera;
  const Eigen::Quaterniond q(pose.linear());
  const Eigen::Vector3d t = pose.translation();
  out.pose.pose.position = {t.x(), t.y(), t.z()};
  out.pose.pose.orientation = {q.x(), q.y(), q.z(), q.w()};
  Matrix6d covariance = no_information * Matrix6d::Identity();
  Vector6d twist = Vector6d::Zero();
  double dt = 1.0;
  if (step_known) {
    covariance = estimate.step_covariance;
    const Pose& step = estimate.T_previous_camera;
    if (with_scale) {
      const Eigen::Vector3d moved = step.linear().transpose() * step.translation();
      const double sigma = std::min(1.0, estimate.log_scale_sigma);
      covariance.topLeftCorner<3, 3>() += sigma * sigma * moved * moved.transpose();
    }
    dt = 1e-9 * static_cast<double>(estimate.stamp_ns - estimate.previous_stamp_ns);
    twist = se3_log(step) / dt;
  }
  const Matrix6d parent = about_parent_axes(pose, covariance);
  std::copy_n(parent.data(), parent.size(), out.pose.covariance.begin());  // symmetric: order is free
  out.twist.twist.linear = {twist[0], twist[1], twist[2]};
  out.twist.twist.angular = {twist[3], twist[4], twist[5]};
  const Matrix6d rate = covariance / (dt * dt);
  std::copy_n(rate.data(), rate.size(), out.twist.covariance.begin());
}

void fill(const Estimate& estimate, const Prior* prior, adit_msgs::msg::ThermalHealth& out) {
  using Health = adit_msgs::msg::ThermalHealth;
  const bool measured = estimate.measured;
  switch (estimate.status) {
    case Status::tracking:
      out.state = Health::OK;
      break;
    case Status::initialising:
    case Status::low_texture:
      out.state = Health::INITIALIZING;
      break;
    case Status::frozen:
    case Status::ffc:
      out.state = Health::FROZEN;
      break;
    case Status::recovering:
      out.state = Health::RECOVERING;
      break;
    case Status::invalid_frame:
      out.state = Health::LOST;
      break;
  }
  out.flags = 0;
  if (estimate.scale != ScaleState::metric) out.flags |= Health::FLAG_MONO_SCALE;
  constexpr int few_points = 150;
  if (estimate.status == Status::low_texture || (measured && estimate.points < few_points))
    out.flags |= Health::FLAG_WEAK_TEXTURE;
  if (estimate.verdict == Verdict::saturated) out.flags |= Health::FLAG_SATURATED;
  out.keyframe_id = static_cast<std::uint32_t>(estimate.counters.keyframes);
  out.residuals = measured ? static_cast<std::uint32_t>(estimate.points) * 8 : 0;
  out.active_points = measured ? static_cast<std::uint32_t>(estimate.points) : 0;
  out.inlier_share = estimate.inlier_share;
  out.anchored_share =
      estimate.selected > 0 ? static_cast<float>(estimate.anchored) / static_cast<float>(estimate.selected) : 0.0F;
  out.residual_rms = estimate.residual;
  out.noise_sigma = estimate.noise_counts;
  out.gain = estimate.gain;
  out.offset = estimate.offset;
  out.parallax = estimate.flow;
  out.scale_sigma = static_cast<float>(estimate.log_scale_sigma);
  out.weakest_direction = {0.0, 0.0, 0.0};
  out.weakest_information = 0.0;
  if (!measured) return;

  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(estimate.step_covariance.topLeftCorner<3, 3>());
  const Eigen::Vector3d weakest = solver.eigenvectors().col(2);
  const double variance = solver.eigenvalues()(2);
  out.weakest_direction = {weakest.x(), weakest.y(), weakest.z()};
  out.weakest_information = 1.0 / std::max(variance, 1e-12);
  constexpr double weak = 0.05;  // m, or the map's unit, of one alignment
  const Eigen::Vector3d moved = estimate.T_previous_camera.translation();
  if (variance > weak * weak) {
    out.flags |= Health::FLAG_DEGENERATE;
    if (std::abs(weakest.dot(moved)) > 0.7 * moved.norm() && moved.norm() > 0.0)
      out.flags |= Health::FLAG_ALONG_TRACK_WEAK;
  }
  if (prior != nullptr && estimate.previous_stamp_ns != 0 && estimate.scale != ScaleState::arbitrary) {
    const Vector6d difference = se3_log(estimate.T_previous_camera * prior->T_previous_current.inverse());
    const Matrix6d spread = prior->covariance + estimate.step_covariance;
    constexpr double limit = 22.46;  // chi-square, 6 degrees of freedom, 0.1 %
    if (difference.dot(spread.ldlt().solve(difference)) > limit) out.flags |= Health::FLAG_PRIOR_DISAGREES;
  }
}

}  // namespace adit::thermal_odometry
