#include "components/state_estimator/component_messages.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "adit_msgs/msg/fusion_status.hpp"
#include "components/state_estimator/correction.hpp"
#include "nav_msgs/msg/odometry.hpp"

namespace adit::state_estimator {

using adit_msgs::msg::FusionStatus;
using adit_msgs::msg::SensorStatus;
using nav_msgs::msg::Odometry;

namespace {

constexpr double not_estimated = 1e6;  // variance of height, roll and pitch

// How much the last measurement counted: 1 in full, 0 not at all.
double weight_of(const SensorReport& report, const GateConfig& gate, double limit) {
  if (!report.healthy) return 0.0;
  if (limit <= 0.0) return 1.0;
  if (report.nis > limit) return 0.0;
  const double certain = chi_square(report.nis_dof, Quantile::p95);
  const double robust = gate.robust && report.nis > certain ? std::sqrt(certain / report.nis) : 1.0;
  return robust / std::max(1.0, report.noise_factor);
}

void fill(const SensorReport& report, const Arrival& arrival, const Config& config, std::int64_t now,
          SensorStatus& out) {
  const bool arrives = arrival.last_ns != kNoStamp && seconds_between(arrival.last_ns, now) <= config.outage_s;
  out.name = report.name;
  const bool doubtful = report.suspicion >= 0.5;
  out.health = !arrives                      ? SensorStatus::ABSENT
               : report.distrusted           ? SensorStatus::FAULTY
               : report.healthy && !doubtful ? SensorStatus::HEALTHY
                                             : SensorStatus::DEGRADED;
  out.reason = !arrives            ? "no data"
               : report.distrusted ? "contradicted by another sensor"
               : !report.healthy   ? "its data is not fused"
               : doubtful          ? "in doubt by its own account"
                                   : "";
  out.age = report.age_s;
  out.nis = report.nis;
  out.nis_mean = report.mean_nis_per_dof;
  out.degrees_of_freedom = static_cast<std::uint8_t>(report.nis_dof);
  const bool gated = config.gate.enabled && report.nis_dof > 0;
  out.gate = gated ? chi_square(report.nis_dof, Quantile::p99_9) : 0.0;
  out.weight = weight_of(report, config.gate, out.gate);
  out.accepted = report.accepted;
  out.rejected = report.rejected + report.distrusted_count;
  out.late = arrival.late;
  out.dropped = report.too_old + report.duplicates + report.future + report.malformed + report.gaps + report.jumps;
}

std::uint8_t mode_of(const Status& status) {
  if (!began(status)) return FusionStatus::MODE_INITIALIZING;
  switch (status.mode) {
    case Mode::fused:
      return FusionStatus::MODE_FUSED;
    case Mode::lidar:
      return FusionStatus::MODE_LIDAR;
    case Mode::thermal:
      return FusionStatus::MODE_THERMAL;
    default:
      return FusionStatus::MODE_DEAD_RECKONING;
  }
}

}  // namespace

std::optional<Matrix6d> reported_information(const Odometry& message, const Eigen::Matrix3d& rotation) {
  const Matrix6d covariance =
      Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(message.pose.covariance.data());
  if (!covariance.allFinite()) return std::nullopt;
  Matrix6d to_sensor = Matrix6d::Zero();
  to_sensor.topLeftCorner<3, 3>() = to_sensor.bottomRightCorner<3, 3>() = rotation.transpose();
  return information_from_covariance(to_sensor * covariance * to_sensor.transpose());
}

void fill(const Estimate& estimate, Odometry& out) {
  const Eigen::Quaterniond q(estimate.pose.linear());
  const Eigen::Vector3d t = estimate.pose.translation();
  out.pose.pose.position = {t.x(), t.y(), t.z()};
  out.pose.pose.orientation = {q.x(), q.y(), q.z(), q.w()};
  out.twist.twist.linear = {estimate.speed, 0.0, 0.0};
  out.twist.twist.angular = {0.0, 0.0, estimate.yaw_rate};
  out.pose.covariance.fill(0.0);
  out.twist.covariance.fill(0.0);
  for (const std::size_t i : {2, 3, 4}) out.pose.covariance[7 * i] = not_estimated;
  for (const std::size_t i : {1, 2, 3, 4}) out.twist.covariance[7 * i] = not_estimated;
  constexpr std::size_t planar[3] = {0, 1, 5};
  constexpr std::size_t motion[2] = {0, 5};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out.pose.covariance[6 * planar[i] + planar[j]] = estimate.pose_covariance(i, j);
  }
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) out.twist.covariance[6 * motion[i] + motion[j]] = estimate.twist_covariance(i, j);
  }
}

bool began(const Status& status) {
  return std::any_of(status.sensors.begin(), status.sensors.end(), [](const SensorReport& r) { return r.age_s >= 0; });
}

void fill(const Estimate& estimate, const Status& status, const Arrivals& arrivals, const Config& config,
          std::int64_t now, FusionStatus& out) {
  out.mode = mode_of(status);
  out.thermal_scale = status.thermal_scale;
  out.thermal_scale_sigma = status.thermal_scale_sigma;
  out.thermal_delay = status.thermal_delay;
  out.thermal_delay_sigma = status.thermal_delay_sigma;
  out.replays = status.replays;
  const double heading = yaw(estimate.pose.linear());
  const Eigen::Vector2d ahead(std::cos(heading), std::sin(heading)), left(-ahead.y(), ahead.x());
  const Eigen::Matrix2d p = estimate.pose_covariance.topLeftCorner<2, 2>();
  out.along_track_sigma = std::sqrt(std::max(0.0, ahead.dot(p * ahead)));
  out.cross_track_sigma = std::sqrt(std::max(0.0, left.dot(p * left)));
  out.yaw_sigma = std::sqrt(std::max(0.0, estimate.pose_covariance(2, 2)));
  out.stationary = false;
  out.sensors.clear();
  constexpr std::array<std::string_view, kInputs> inputs{"lidar", "thermal", "imu", "gnss"};
  for (const SensorReport& report : status.sensors) {
    if (report.name == "zero_velocity") out.stationary = report.age_s >= 0.0 && report.age_s < 0.3;
    const auto input = std::find(inputs.begin(), inputs.end(), report.name);
    if (input == inputs.end()) continue;
    fill(report, arrivals[static_cast<std::size_t>(input - inputs.begin())], config, now, out.sensors.emplace_back());
  }
}

}  // namespace adit::state_estimator
