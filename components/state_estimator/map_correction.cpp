#include "components/state_estimator/map_correction.hpp"

#include <cmath>

#include <Eigen/Cholesky>

#include "components/geometry/se3.hpp"

namespace adit::state_estimator {

PlanarPose compose(const PlanarPose& a_b, const PlanarPose& b_c) {
  const double c = std::cos(a_b.z()), s = std::sin(a_b.z());
  return {a_b.x() + c * b_c.x() - s * b_c.y(), a_b.y() + s * b_c.x() + c * b_c.y(), wrap_angle(a_b.z() + b_c.z())};
}

PlanarPose inverse(const PlanarPose& a_b) {
  const double c = std::cos(a_b.z()), s = std::sin(a_b.z());
  return {-c * a_b.x() - s * a_b.y(), s * a_b.x() - c * a_b.y(), wrap_angle(-a_b.z())};
}

MapCorrection::Outcome MapCorrection::add(const PlanarPose& map_body, const Eigen::Matrix3d& covariance,
                                          const PlanarPose& odom_body, const Eigen::Matrix3d& odom_drift) {
  if (!map_body.allFinite() || !covariance.allFinite() || !odom_body.allFinite() || !odom_drift.allFinite()) {
    return Outcome::malformed;
  }
  // Work in the pose at the body: there the closure and the drift are what they are; map_odom follows from it.
  const PlanarPose predicted = compose(map_odom_, odom_body);
  PlanarPose innovation = map_body - predicted;
  innovation.z() = wrap_angle(innovation.z());
  Eigen::Matrix3d to_body = Eigen::Matrix3d::Identity();  // d predicted / d map_odom
  const Eigen::Vector2d arm = predicted.head<2>() - map_odom_.head<2>();
  to_body(0, 2) = -arm.y();
  to_body(1, 2) = arm.x();
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();  // drift is given in odom axes
  turn.topLeftCorner<2, 2>() << std::cos(map_odom_.z()), -std::sin(map_odom_.z()), std::sin(map_odom_.z()),
      std::cos(map_odom_.z());
  const Eigen::Matrix3d prior = to_body * p_ * to_body.transpose() + turn * odom_drift * turn.transpose();
  Eigen::Matrix3d noise = 0.5 * (covariance + covariance.transpose());
  noise.diagonal() += Eigen::Vector3d(config_.position_floor, config_.position_floor, config_.yaw_floor).cwiseAbs2();
  const Eigen::Matrix3d s = prior + noise;
  const Eigen::LLT<Eigen::Matrix3d> cholesky(s);
  if (cholesky.info() != Eigen::Success) return Outcome::malformed;
  const bool first = applied_ == 0;
  if (!first && innovation.dot(cholesky.solve(innovation)) > config_.gate) {
    ++rejected_;
    return Outcome::rejected;
  }
  const Eigen::Matrix3d gain = first ? Eigen::Matrix3d::Identity() : Eigen::Matrix3d(cholesky.solve(prior).transpose());
  PlanarPose body = predicted + gain * innovation;
  body.z() = wrap_angle(body.z());
  const Eigen::Matrix3d rest = Eigen::Matrix3d::Identity() - gain;
  const Eigen::Matrix3d at_body = rest * prior * rest.transpose() + gain * noise * gain.transpose();
  map_odom_ = compose(body, inverse(odom_body));
  Eigen::Matrix3d from_body = Eigen::Matrix3d::Identity();  // d map_odom / d body
  const Eigen::Vector2d new_arm = body.head<2>() - map_odom_.head<2>();
  from_body(0, 2) = new_arm.y();
  from_body(1, 2) = -new_arm.x();
  p_ = from_body * at_body * from_body.transpose();
  p_ = 0.5 * (p_ + p_.transpose()).eval();
  ++applied_;
  return Outcome::applied;
}

}  // namespace adit::state_estimator
