#include "components/state_estimator/odometry_input.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace adit::state_estimator {
namespace {

// A motion over a longer interval says nothing about the speed of now: it is not compared with other sensors'.
constexpr double kComparable = 1.0;  // s

// Body motion in levelled axes of the heading at `from`.
struct PlanarMotion {
  Pose body = Pose::Identity();                        // motion of base_link
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  // body axes at `to` seen in the levelled axes at `from`
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  double turn = 0.0;

  PlanarMotion(const RelativeMotion& input, const Pose& body_from_sensor)
      : body(body_from_sensor * input.motion * body_from_sensor.inverse()),
        axes(input.level * body.linear()),
        shift(input.level * body.translation()),
        turn(yaw(axes)) {}
};

// Information about (dx, dy, dpsi), the rest marginalized: Schur complement over height, roll and pitch, which a body
// on the ground knows to about a metre and a radian even when the sensor does not.
Eigen::Matrix3d planar_information(const Matrix6d& information, const PlanarMotion& planar,
                                   const Pose& body_from_sensor) {
  Matrix6d to_planar = Matrix6d::Zero();  // d(levelled shift, levelled rotation) / d(sensor perturbation), inverted
  to_planar.topLeftCorner<3, 3>() = planar.axes.transpose();
  to_planar.bottomRightCorner<3, 3>() = planar.axes.transpose();
  // A tilted body's heading also turns with roll and pitch: d psi = eta_z - tilt * eta_xy.
  const Eigen::Vector3d ahead = planar.axes.col(0);
  const Eigen::Vector2d tilt = ahead.z() / ahead.head<2>().squaredNorm() * ahead.head<2>();
  Matrix6d heading = Matrix6d::Identity();
  heading.block<1, 2>(5, 3) = tilt.transpose();
  const Matrix6d jacobian = se3_adjoint(body_from_sensor.inverse()) * to_planar * heading;
  const Matrix6d full = jacobian.transpose() * information * jacobian;
  constexpr int kept[3] = {0, 1, 5};
  constexpr int rest[3] = {2, 3, 4};
  Eigen::Matrix3d a, b, c;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      a(i, j) = full(kept[i], kept[j]);
      b(i, j) = full(kept[i], rest[j]);
      c(i, j) = full(rest[i], rest[j]) + (i == j ? 1.0 : 0.0);
    }
  }
  const Eigen::Matrix3d schur = a - b * c.ldlt().solve(b.transpose());
  return 0.5 * (schur + schur.transpose());
}

Eigen::Matrix3d configured_covariance(const PlanarMotion& planar, const OdometryConfig& config) {
  const double distance = planar.shift.head<2>().norm();
  const double position = square(config.sigma_position) + square(config.position_fraction * distance);
  const double turn = square(config.sigma_yaw) + square(config.yaw_fraction * planar.turn);
  return Eigen::Vector3d(position, position, turn).asDiagonal();
}

// Keeps the directions with information: projection rows and a diagonal covariance. Lengths and angles are made
// comparable by their acceptable deviations.
void keep_informative(const Eigen::Matrix3d& information, const OdometryConfig& config, Measurement& out) {
  const Eigen::Vector3d unit(config.max_sigma_position, config.max_sigma_position, config.max_sigma_yaw);
  const Eigen::Vector3d floor(config.floor_position, config.floor_position, config.floor_yaw);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(unit.asDiagonal() * information * unit.asDiagonal());
  out.rows = 0;
  out.projection.setZero();
  out.covariance.setZero();
  for (int i = 2; i >= 0; --i) {
    const double strength = solver.eigenvalues()(i);
    if (!(strength > 1.0)) break;
    const Eigen::Vector3d direction = solver.eigenvectors().col(i);
    const double variance = 1.0 / strength + direction.cwiseProduct(floor.cwiseQuotient(unit)).squaredNorm();
    out.projection.row(out.rows) = direction.cwiseQuotient(unit).transpose();
    out.covariance(out.rows, out.rows) = variance;
    ++out.rows;
  }
}

// The same in (v, psi'): a diagonal pair; a row without information is left out.
void keep_rates(const Eigen::Vector2d& variances, const Eigen::Vector2d& limits, Measurement& out) {
  out.rows = 0;
  out.projection.setZero();
  out.covariance.setZero();
  for (int i = 0; i < 2; ++i) {
    if (!(variances(i) <= limits(i))) continue;
    out.projection(out.rows, i) = 1.0;
    out.covariance(out.rows, out.rows) = variances(i);
    ++out.rows;
  }
}

}  // namespace

Conversion to_measurement(const RelativeMotion& input, const OdometryConfig& config, std::uint8_t sensor,
                          Measurement& out) {
  const double span = seconds_between(input.from_ns, input.to_ns);
  if (!input.motion.matrix().allFinite() || !input.level.allFinite() || !std::isfinite(input.suspicion) ||
      !std::isfinite(input.log_scale_sigma.value_or(0.0))) {
    return Conversion::not_finite;
  }
  if ((input.motion.linear() * input.motion.linear().transpose() - Eigen::Matrix3d::Identity()).norm() > 1e-3) {
    return Conversion::not_finite;
  }
  if (input.information && !input.information->allFinite()) return Conversion::not_finite;
  const double longest = std::max(config.max_interval_s, 1.5 * config.anchor_period_s);
  if (!(span > 0.0) || span > longest) return Conversion::bad_interval;

  const PlanarMotion planar(input, config.body_from_sensor);
  const Vector6d twist = se3_log(planar.body) / span;
  // The signed mean speed along the arc and the heading rate: the midpoint values for constant accelerations.
  const double half = 0.5 * planar.turn;
  const double arc = std::abs(half) > 1e-6 ? half / std::sin(half) : 1.0;
  const double along = std::cos(half) * planar.shift.x() + std::sin(half) * planar.shift.y();
  const double speed = along * arc / span;
  const double yaw_rate = planar.turn / span;
  if (twist.head<3>().norm() > config.max_speed || std::abs(yaw_rate) > config.max_yaw_rate) {
    return Conversion::implausible;
  }

  const bool reported = input.information && !config.fixed_noise;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  if (reported) {
    information = planar_information(*input.information, planar, config.body_from_sensor);
  } else {
    information = configured_covariance(planar, config).inverse();
  }

  out = Measurement{};
  out.sensor = sensor;
  out.log_scale_sigma = std::clamp(input.log_scale_sigma.value_or(0.0), 0.0, 1.0);
  const double jitter = square(config.stamp_jitter_s / span);
  Eigen::Vector2d rate_variance(square(config.sigma_speed) + square(config.speed_fraction * speed),
                                square(config.sigma_yaw_rate));
  if (reported) {
    // Along the heading and about the vertical, the sideways part marginalized.
    Eigen::Vector2d marginal;
    const double side = information(1, 1) + 1.0;
    marginal(0) = information(0, 0) - square(information(0, 1)) / side;
    marginal(1) = information(2, 2) - square(information(2, 1)) / side;
    const double couple = information(0, 2) - information(0, 1) * information(1, 2) / side;
    const double det = marginal(0) * marginal(1) - couple * couple;
    const double tiny = 1e-12;
    rate_variance(0) = det > tiny ? marginal(1) / det : (marginal(0) > tiny ? 1.0 / marginal(0) : 1e12);
    rate_variance(1) = det > tiny ? marginal(0) / det : (marginal(1) > tiny ? 1.0 / marginal(1) : 1e12);
    rate_variance(0) = (rate_variance(0) + square(config.floor_position)) / square(span);
    rate_variance(1) = (rate_variance(1) + square(config.floor_yaw)) / square(span);
  }
  rate_variance(0) += square(speed) * jitter;
  rate_variance(1) += square(yaw_rate) * jitter;
  const Eigen::Vector2d limits(square(config.max_sigma_position / span), square(config.max_sigma_yaw / span));

  if (config.relative_pose) {
    out.stamp_ns = input.to_ns;
    out.anchor_ns = input.from_ns;
    out.value << planar.shift.x(), planar.shift.y(), planar.turn;
    keep_informative(information, config, out);
    if (jitter > 0.0) {
      const Eigen::Vector3d spread = out.projection * out.value;
      out.covariance.topLeftCorner(out.rows, out.rows) +=
          jitter * (spread.head(out.rows) * spread.head(out.rows).transpose());
    }
  } else {
    out.stamp_ns = input.from_ns + (input.to_ns - input.from_ns) / 2;
    out.value << speed, yaw_rate, 0.0;
    keep_rates(rate_variance, config.fixed_noise ? Eigen::Vector2d(1e300, 1e300) : limits, out);
  }
  out.motion.valid = span <= kComparable;
  out.motion.has_speed = rate_variance(0) <= limits(0);
  out.motion.speed = speed;
  out.motion.speed_variance = rate_variance(0);
  out.motion.yaw_rate = yaw_rate;
  out.motion.yaw_rate_variance = rate_variance(1);
  out.motion.suspicion = std::clamp(input.suspicion, 0.0, 1.0);
  out.motion.frozen = input.motion.matrix().isIdentity(1e-12);
  return Conversion::ok;
}

std::optional<Matrix6d> information_from_covariance(const Matrix6d& covariance) {
  if (!covariance.allFinite() || covariance.diagonal().minCoeff() < 0.0 || covariance.isZero(0.0)) return std::nullopt;
  const Matrix6d symmetric = (0.5 * covariance + 0.5 * covariance.transpose()).cwiseMin(1e14).cwiseMax(-1e14);
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(symmetric);
  if (solver.info() != Eigen::Success) return std::nullopt;
  Vector6d inverse;
  for (int i = 0; i < 6; ++i) {
    const double variance = std::max(solver.eigenvalues()(i), 1e-14);
    inverse(i) = variance < 1e12 ? 1.0 / variance : 0.0;
  }
  return Matrix6d(solver.eigenvectors() * inverse.asDiagonal() * solver.eigenvectors().transpose());
}

}  // namespace adit::state_estimator
