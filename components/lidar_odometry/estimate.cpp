#include "components/lidar_odometry/estimate.hpp"

#include <algorithm>

#include <Eigen/Cholesky>

namespace adit::lidar_odometry {

Prior combined(const Prior& first, const Prior& second) {
  Prior result = first;
  if (!result.twist) result.twist = second.twist;
  const Matrix6d information = first.information + second.information;
  // What neither knows stays as the first has it.
  const Matrix6d regular = information + Matrix6d(1e-9 * information.trace() * Matrix6d::Identity());
  const Vector6d step = regular.ldlt().solve(second.information * se3_log(first.pose.inverse() * second.pose));
  if (!step.allFinite() || !(information.trace() > 0.0)) return result;
  result.information = information;
  result.pose = first.pose * se3_exp(step);
  result.pose.linear() = orthonormalized(result.pose.linear());
  return result;
}

std::string_view to_string(Status status) {
  switch (status) {
    case Status::initialising:
      return "initialising";
    case Status::ok:
      return "ok";
    case Status::degenerate:
      return "degenerate";
    case Status::too_few_points:
      return "too few points";
    case Status::bad_stamp:
      return "bad stamp";
    case Status::bad_cloud:
      return "bad cloud";
    case Status::lost:
      return "lost";
    case Status::restarted:
      return "restarted";
  }
  return "unknown";
}

bool registered(Status status) {
  return status == Status::ok || status == Status::degenerate;
}

int Localizability::unobservable() const {
  const auto count = [](const std::array<Direction, 3>& directions) {
    return std::count_if(directions.begin(), directions.end(), [](const Direction& d) { return !d.observable; });
  };
  return static_cast<int>(count(translation) + count(rotation));
}

Matrix6d covariance_in_parent_axes(const Pose& pose, const Matrix6d& covariance) {
  Matrix6d rotation = Matrix6d::Zero();
  rotation.topLeftCorner<3, 3>() = rotation.bottomRightCorner<3, 3>() = pose.linear();
  return rotation * covariance * rotation.transpose();
}

}  // namespace adit::lidar_odometry
