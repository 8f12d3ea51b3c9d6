#include "bringup/commands/odometry_output.hpp"

#include <fstream>

#include "components/runtime/stamp.hpp"

namespace adit {

StampedPose stamped_pose(const nav_msgs::msg::Odometry& message) {
  StampedPose pose;
  pose.stamp_ns = to_time(message.header.stamp).time_since_epoch().count();
  const auto& p = message.pose.pose.position;
  const auto& q = message.pose.pose.orientation;
  pose.pose.linear() = Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized().toRotationMatrix();
  pose.pose.translation() = Eigen::Vector3d(p.x, p.y, p.z);
  return pose;
}

Result<void> write_timing(const std::string& path, std::span<const FileTiming> timing) {
  std::ofstream file(path);
  file << "stamp_ns,ms\n";
  for (const FileTiming& one : timing) file << one.stamp_ns << ',' << one.milliseconds << '\n';
  file.flush();
  if (!file) return Error{ErrorCode::io, path + ": cannot write"};
  return {};
}

}  // namespace adit
