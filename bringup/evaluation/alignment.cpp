#include "bringup/evaluation/alignment.hpp"

#include <cmath>

#include <Eigen/SVD>

namespace adit::evaluation {
namespace {

constexpr double kStandsStill = 1e-6;  // m^2: the variance of positions within 1 mm

struct Moments {
  Eigen::Vector3d mean_truth = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_estimate = Eigen::Vector3d::Zero();
  double variance_truth = 0.0;
  double variance_estimate = 0.0;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of (truth, estimate)
};

Moments moments(std::span<const Pose> truth, std::span<const Pose> estimate) {
  Moments m;
  const double n = static_cast<double>(truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    m.mean_truth += truth[i].translation() / n;
    m.mean_estimate += estimate[i].translation() / n;
  }
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Eigen::Vector3d y = truth[i].translation() - m.mean_truth;
    const Eigen::Vector3d x = estimate[i].translation() - m.mean_estimate;
    m.variance_truth += y.squaredNorm() / n;
    m.variance_estimate += x.squaredNorm() / n;
    m.covariance += y * x.transpose() / n;
  }
  return m;
}

Eigen::Matrix3d rotation_about_z(double angle) {
  return Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

// The rotation that maximizes trace(R^T C): Umeyama's U S V^T, or its restriction to the vertical axis.
Eigen::Matrix3d best_rotation(const Eigen::Matrix3d& c, bool yaw_only) {
  return yaw_only ? rotation_about_z(std::atan2(c(1, 0) - c(0, 1), c(0, 0) + c(1, 1))) : orthonormalized(c);
}

Eigen::Matrix3d least_squares_rotation(const Moments& m, std::span<const Pose> truth, std::span<const Pose> estimate,
                                       bool yaw_only) {
  const Eigen::Vector3d singular = Eigen::JacobiSVD<Eigen::Matrix3d>(m.covariance).singularValues();
  if (singular(1) > 1e-9 * singular(0) && singular(0) > kStandsStill) {
    return best_rotation(m.covariance, yaw_only);
  }
  Eigen::Matrix3d orientations = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < truth.size(); ++i) {
    orientations += truth[i].linear() * estimate[i].linear().transpose() / static_cast<double>(truth.size());
  }
  const double weight = singular(0) > kStandsStill ? 1e-6 * singular(0) : 1.0;
  return best_rotation(m.covariance + weight * orientations, yaw_only);
}

double least_squares_scale(const Moments& m, const Eigen::Matrix3d& rotation) {
  return (rotation.transpose() * m.covariance).trace() / m.variance_estimate;
}

}  // namespace

Result<Alignment> parse_alignment(const std::string& name) {
  for (const Alignment a : {Alignment::none, Alignment::first_pose, Alignment::se3, Alignment::sim3}) {
    if (name == to_string(a)) return a;
  }
  return Error{ErrorCode::invalid_argument, "unknown alignment '" + name + "': use none, first_pose, se3 or sim3"};
}

std::string to_string(Alignment alignment) {
  switch (alignment) {
    case Alignment::none:
      return "none";
    case Alignment::first_pose:
      return "first_pose";
    case Alignment::se3:
      return "se3";
    case Alignment::sim3:
      return "sim3";
  }
  return "?";
}

Pose Similarity::apply(const Pose& pose) const {
  Pose moved = Pose::Identity();
  moved.linear() = rotation * pose.linear();
  moved.translation() = scale * (rotation * pose.translation()) + translation;
  return moved;
}

Result<Similarity> align(std::span<const Pose> truth, std::span<const Pose> estimate, Alignment alignment,
                         bool yaw_only) {
  if (truth.empty() || truth.size() != estimate.size()) {
    return Error{ErrorCode::invalid_argument, "alignment needs two pose lists of equal, non-zero length"};
  }
  Similarity s;
  if (alignment == Alignment::none) return s;
  if (alignment == Alignment::first_pose) {
    const Eigen::Matrix3d rotation = truth[0].linear() * estimate[0].linear().transpose();
    s.rotation =
        yaw_only ? rotation_about_z(yaw(truth[0].linear()) - yaw(estimate[0].linear())) : orthonormalized(rotation);
    s.translation = truth[0].translation() - s.rotation * estimate[0].translation();
    return s;
  }
  const Moments m = moments(truth, estimate);
  s.rotation = least_squares_rotation(m, truth, estimate, yaw_only);
  if (alignment == Alignment::sim3) {
    if (m.variance_estimate < kStandsStill) {
      return Error{ErrorCode::invalid_argument,
                   "sim3 alignment: the estimate stands still, its scale is not determined; use first_pose or se3"};
    }
    s.scale = least_squares_scale(m, s.rotation);
    if (s.scale <= 0.0) {
      return Error{
          ErrorCode::invalid_argument,
          "sim3 alignment: the estimate does not resemble the truth (no positive scale); use first_pose or se3"};
    }
  }
  s.translation = m.mean_truth - s.scale * (s.rotation * m.mean_estimate);
  return s;
}

std::optional<double> similarity_scale(std::span<const Pose> truth, std::span<const Pose> estimate) {
  if (truth.empty() || truth.size() != estimate.size()) return std::nullopt;
  const Moments m = moments(truth, estimate);
  if (m.variance_truth < kStandsStill || m.variance_estimate < kStandsStill) return std::nullopt;
  return least_squares_scale(m, least_squares_rotation(m, truth, estimate, false));
}

}  // namespace adit::evaluation
