#include "components/lidar_odometry/sweep.hpp"

#include <algorithm>
#include <cmath>

#include "components/geometry/rigid.hpp"

namespace adit::lidar_odometry {

bool consistent(const Cloud& cloud) {
  const std::size_t n = cloud.points.size();
  const auto fits = [n](std::size_t size) { return size == 0 || size == n; };
  if (!fits(cloud.seconds.size()) || !fits(cloud.nanoseconds.size()) || !fits(cloud.rings.size())) return false;
  return cloud.height <= 1 || (n % cloud.height == 0 && n / cloud.height == cloud.width);
}

double point_time(const Cloud& cloud, std::size_t i) {
  return cloud.seconds.empty() ? 1e-9 * cloud.nanoseconds[i] : static_cast<double>(cloud.seconds[i]);
}

std::optional<TimeSpan> time_span(const Cloud& cloud) {
  constexpr double limit = 10.0;
  if (cloud.points.empty() || (cloud.seconds.empty() && cloud.nanoseconds.empty())) return std::nullopt;
  TimeSpan span{limit, -limit};
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const double time = point_time(cloud, i);
    if (!(std::abs(time) < limit)) return std::nullopt;
    span.first = std::min(span.first, time);
    span.last = std::max(span.last, time);
  }
  return span;
}

SweepMotion::SweepMotion(const Vector6d& twist, TimeSpan span, double reference_time)
    : reference_time_(reference_time) {
  const double duration = span.last - span.first;
  if (!(duration > 0.0) || twist.isZero(0.0)) return;
  moving_ = true;
  first_ = span.first;
  inverse_step_ = intervals / duration;
  for (int i = 0; i <= intervals; ++i) {
    const double time = span.first + duration * i / intervals;
    poses_[static_cast<std::size_t>(i)] = se3_exp((time - reference_time) * twist).matrix().topRows<3>();
  }
}

SweepMotion::SweepMotion(std::span<const StampedPose> poses, std::int64_t stamp_ns, TimeSpan span,
                         double reference_time)
    : reference_time_(reference_time) {
  const double duration = span.last - span.first;
  if (!(duration > 0.0)) return;
  moving_ = true;
  first_ = span.first;
  inverse_step_ = intervals / duration;
  const auto seconds = [&](const StampedPose& pose) { return 1e-9 * static_cast<double>(pose.stamp_ns - stamp_ns); };
  const auto pose_at = [&](double time) {
    const auto after = std::upper_bound(poses.begin() + 1, poses.end() - 1, time,
                                        [&](double t, const StampedPose& pose) { return t < seconds(pose); });
    const StampedPose& from = *(after - 1);
    return se3_interpolate(from.pose, after->pose, (time - seconds(from)) / (seconds(*after) - seconds(from)));
  };
  const Pose reference = pose_at(reference_time).inverse();
  for (int i = 0; i <= intervals; ++i) {
    const double time = span.first + duration * i / intervals;
    poses_[static_cast<std::size_t>(i)] = (reference * pose_at(time)).matrix().topRows<3>();
  }
}

SweepMotion SweepMotion::with_velocity(const Eigen::Vector3d& velocity) const {
  SweepMotion result = *this;
  if (!moving_) return result;
  for (int i = 0; i <= intervals; ++i) {
    const double time = first_ + i / inverse_step_;
    result.poses_[static_cast<std::size_t>(i)].col(3) += (time - reference_time_) * velocity;
  }
  return result;
}

bool follows(std::span<const StampedPose> poses, std::int64_t stamp_ns, TimeSpan span) {
  constexpr double slack = 1e-3;  // s
  if (poses.size() < 2) return false;
  const auto seconds = [&](const StampedPose& pose) { return 1e-9 * static_cast<double>(pose.stamp_ns - stamp_ns); };
  if (seconds(poses.front()) > span.first + slack || seconds(poses.back()) < span.last - slack) return false;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!is_rigid(poses[i].pose) || (i > 0 && poses[i].stamp_ns <= poses[i - 1].stamp_ns)) return false;
  }
  return true;
}

SweepMotion::Affine SweepMotion::at(double time) const {
  const double position = std::clamp((time - first_) * inverse_step_, 0.0, static_cast<double>(intervals));
  const std::size_t i = std::min(static_cast<std::size_t>(position), static_cast<std::size_t>(intervals - 1));
  const double b = position - static_cast<double>(i);
  return (1.0 - b) * poses_[i] + b * poses_[i + 1];
}

Eigen::Vector3d SweepMotion::compensate(const Eigen::Vector3d& point, double time) const {
  if (!moving_) return point;
  const Affine pose = at(time);
  return pose.leftCols<3>() * point + pose.col(3);
}

void read_points(const Cloud& cloud, const SweepMotion& motion, double min_range, double max_range,
                 std::vector<Eigen::Vector3d>& points, ScanCounters& counters) {
  points.clear();
  const double min2 = min_range * min_range;
  const double max2 = max_range * max_range;
  counters.points = static_cast<std::uint32_t>(cloud.points.size());
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Point3f raw = cloud.points[i];
    if (!raw.allFinite() || raw.isZero(0.0f)) {
      ++counters.invalid;
      continue;
    }
    Eigen::Vector3d point = raw.cast<double>();
    if (motion.moving()) point = motion.compensate(point, point_time(cloud, i));
    const double range2 = point.squaredNorm();
    if (!(range2 > min2 && range2 < max2)) {
      ++counters.out_of_range;
      continue;
    }
    points.push_back(point);
  }
}

void downsample(std::span<const Eigen::Vector3d> points, double voxel_size, VoxelFilter& filter,
                std::vector<Eigen::Vector3d>& selected) {
  selected.clear();
  filter.begin(points.size());
  const double inverse_size = 1.0 / voxel_size;
  for (const Eigen::Vector3d& point : points) {
    if (filter.first(pack(cell_of(point, inverse_size)))) selected.push_back(point);
  }
}

}  // namespace adit::lidar_odometry
