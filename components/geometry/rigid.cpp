#include "components/geometry/rigid.hpp"

#include <cmath>
#include <string>

namespace adit {

bool is_rigid(const Pose& pose) {
  const Eigen::Matrix3d r = pose.linear();
  return pose.matrix().allFinite() && pose.translation().norm() < 1e7 && r.determinant() > 0.0 &&
         (r * r.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-3;
}

Result<Pose> pose_from_numbers(std::span<const double> numbers, std::string_view name) {
  if (numbers.size() != 7) {
    return Error{ErrorCode::invalid_argument, std::string(name) + ": 7 numbers are wanted: x y z qx qy qz qw"};
  }
  const Eigen::Map<const Eigen::Matrix<double, 7, 1>> v(numbers.data());
  const Eigen::Quaterniond rotation(v[6], v[3], v[4], v[5]);
  if (!v.allFinite() || !(std::abs(rotation.norm() - 1.0) < 0.01)) {
    return Error{ErrorCode::invalid_argument, std::string(name) + ": not finite, or the quaternion's norm is not 1"};
  }
  Pose pose = Pose::Identity();
  pose.linear() = rotation.normalized().toRotationMatrix();
  pose.translation() = v.head<3>();
  return pose;
}

std::array<double, 7> numbers_of(const Pose& pose) {
  const Eigen::Vector3d t = pose.translation();
  const Eigen::Quaterniond q(pose.linear());
  return {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()};
}

}  // namespace adit
