#include "components/geometry/se3.hpp"

#include <cmath>
#include <numbers>

#include <Eigen/SVD>

namespace adit {
namespace {

// sin(t)/t, (1-cos t)/t^2, (t-sin t)/t^3: by their series below the angle where round-off would show.
struct Coefficients {
  double a, b, c;
};

Coefficients coefficients(double angle) {
  const double t2 = angle * angle;
  if (angle < 1e-2) {
    return {1.0 - t2 / 6.0 + t2 * t2 / 120.0, 0.5 - t2 / 24.0 + t2 * t2 / 720.0,
            1.0 / 6.0 - t2 / 120.0 + t2 * t2 / 5040.0};
  }
  const double s = std::sin(angle);
  const double h = std::sin(0.5 * angle);
  return {s / angle, 2.0 * h * h / t2, (angle - s) / (t2 * angle)};
}

}  // namespace

Eigen::Matrix3d skew(const Eigen::Vector3d& w) {
  Eigen::Matrix3d s;
  s << 0.0, -w.z(), w.y(), w.z(), 0.0, -w.x(), -w.y(), w.x(), 0.0;
  return s;
}

Eigen::Matrix3d so3_exp(const Eigen::Vector3d& theta) {
  const Coefficients k = coefficients(theta.norm());
  const Eigen::Matrix3d s = skew(theta);
  return Eigen::Matrix3d::Identity() + k.a * s + k.b * s * s;
}

Eigen::Vector3d so3_log(const Eigen::Matrix3d& rotation) {
  // Through the quaternion: well conditioned for every angle, also near pi.
  Eigen::Quaterniond q(rotation);
  q.normalize();
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  const double n = q.vec().norm();
  if (n < 1e-9) return 2.0 * q.vec() / q.w();
  return (2.0 * std::atan2(n, q.w()) / n) * q.vec();
}

Eigen::Matrix3d so3_left_jacobian(const Eigen::Vector3d& theta) {
  const Coefficients k = coefficients(theta.norm());
  const Eigen::Matrix3d s = skew(theta);
  return Eigen::Matrix3d::Identity() + k.b * s + k.c * s * s;
}

Eigen::Matrix3d so3_left_jacobian_inverse(const Eigen::Vector3d& theta) {
  const double angle = theta.norm();
  const Eigen::Matrix3d s = skew(theta);
  double d = 1.0 / 12.0 + angle * angle / 720.0;
  if (angle >= 1e-2) {
    const Coefficients k = coefficients(angle);
    d = (1.0 - 0.5 * k.a / k.b) / (angle * angle);
  }
  return Eigen::Matrix3d::Identity() - 0.5 * s + d * s * s;
}

Pose se3_exp(const Vector6d& xi) {
  Pose pose = Pose::Identity();
  pose.linear() = so3_exp(xi.tail<3>());
  pose.translation() = so3_left_jacobian(xi.tail<3>()) * xi.head<3>();
  return pose;
}

Vector6d se3_log(const Pose& pose) {
  Vector6d xi;
  xi.tail<3>() = so3_log(pose.linear());
  xi.head<3>() = so3_left_jacobian_inverse(xi.tail<3>()) * pose.translation();
  return xi;
}

Matrix6d se3_adjoint(const Pose& pose) {
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = pose.linear();
  adjoint.bottomRightCorner<3, 3>() = pose.linear();
  adjoint.topRightCorner<3, 3>() = skew(pose.translation()) * pose.linear();
  return adjoint;
}

Pose se3_interpolate(const Pose& from, const Pose& to, double fraction) {
  return from * se3_exp(fraction * se3_log(from.inverse() * to));
}

double yaw(const Eigen::Matrix3d& rotation) {
  return std::atan2(rotation(1, 0), rotation(0, 0));
}

double wrap_angle(double angle) {
  const double wrapped = std::remainder(angle, 2.0 * std::numbers::pi);
  return wrapped <= -std::numbers::pi ? wrapped + 2.0 * std::numbers::pi : wrapped;
}

Eigen::Matrix3d orthonormalized(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d flip = Eigen::Matrix3d::Identity();
  flip(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return svd.matrixU() * flip * svd.matrixV().transpose();
}

}  // namespace adit
