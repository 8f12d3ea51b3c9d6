#include "components/mapping/keyframes.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace adit::mapping {

Pose along_the_way(const Keyframe& keyframe) {
  const double turn = keyframe.backwards ? std::numbers::pi : 0.0;
  return Pose(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()));
}

KeyframeBuilder::Outcome KeyframeBuilder::add(const Sweep& sweep, const Trajectory& odometry,
                                              const Eigen::Vector3d& unobserved) {
  const std::int64_t end = end_ns(sweep);
  if (last_sweep_ && end <= last_sweep_->stamp_ns) return Outcome::bad_stamp;
  const std::optional<Pose> pose = pose_at(odometry, end);
  if (!pose || !undistort(sweep, odometry, Pose::Identity(), config_.sweep, sweep_, invalid_)) return Outcome::no_poses;
  if (sweep_.empty()) return Outcome::no_points;
  const StampedPose now{end, *pose};
  if (last_sweep_) {
    const double seconds = 1e-9 * static_cast<double>(end - last_sweep_->stamp_ns);
    const double step = (now.pose.translation() - last_sweep_->pose.translation()).norm();
    if (step > config_.max_speed * std::max(seconds, 0.05)) {
      jumped_ = true;
      local_.clear();
    }
  }
  last_sweep_ = now;
  local_.insert(sweep_);
  if (!unobserved.isZero()) unobserved_ = unobserved;

  const Pose since = keyframe_.odom.inverse() * now.pose;
  const bool far = since.translation().norm() >= config_.distance || so3_log(since.linear()).norm() >= config_.angle;
  if (any_keyframe_ && !far && !jumped_) return Outcome::taken;
  make_keyframe(now);
  return Outcome::keyframe;
}

void KeyframeBuilder::make_keyframe(const StampedPose& now) {
  const Eigen::Vector3f here = now.pose.translation().cast<float>();
  local_.keep_within(here, static_cast<float>(config_.local_radius));
  const Points around = local_.points();

  Keyframe next;
  next.stamp_ns = now.stamp_ns;
  next.odom = now.pose;
  next.after_jump = jumped_;
  next.unobserved = unobserved_;
  next.sections_end = keyframe_.sections_end;
  next.way = keyframe_.way;
  sections_.clear();
  if (any_keyframe_ && !jumped_) {
    const Eigen::Vector3d moved = now.pose.translation() - keyframe_.odom.translation();
    const double step = moved.norm();
    next.way += step;
    next.backwards = moved.dot(now.pose.linear().col(0)) < 0.0;
    const auto count = static_cast<std::size_t>(std::lround(step / section_spacing));
    const Pose along = along_the_way(next);
    sections_ = cut_sections(around, keyframe_.odom * along, now.pose * along, count, config_.section_reach);
    next.sections_end += sections_.size();
  }
  VoxelGrid grid(config_.voxel);
  const Eigen::Isometry3f back = now.pose.inverse().cast<float>();
  const auto radius2 = static_cast<float>(config_.radius * config_.radius);
  for (const Point& point : around) {
    const Point seen{back * point.position, point.intensity};
    if (seen.position.squaredNorm() < radius2) grid.insert(seen);
  }
  next.points = grid.points();
  keyframe_ = std::move(next);
  any_keyframe_ = true;
  jumped_ = false;
  unobserved_.setZero();
}

}  // namespace adit::mapping
