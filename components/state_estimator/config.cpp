#include "components/state_estimator/config.hpp"

#include <cmath>
#include <set>

namespace adit::state_estimator {
namespace {

OdometrySensor lidar() {
  OdometrySensor s;
  s.name = "lidar";
  s.role = Role::lidar;
  s.odometry.sigma_speed = 0.05;
  s.odometry.sigma_yaw_rate = 0.0015;
  return s;
}

OdometrySensor thermal() {
  OdometrySensor s;
  s.name = "thermal";
  s.role = Role::thermal;
  s.odometry.sigma_speed = 0.05;
  s.odometry.speed_fraction = 0.04;
  s.odometry.sigma_yaw_rate = 0.004;
  s.odometry.position_fraction = 0.03;
  return s;
}

}  // namespace

Config Config::paper() {
  Config c;
  c.process.noise = ProcessNoise{.jerk = 1.0,
                                 .yaw_jerk = 0.05,
                                 .accel = 0.01,
                                 .yaw_accel = 1e-4,
                                 .position = 1e-4,
                                 .yaw = 1e-6,
                                 .scale = 0.0,
                                 .thermal_yaw_bias = 0.0,
                                 .thermal_delay = 0.0,
                                 .gyro_bias = 0.0,
                                 .accel_bias = 0.0,
                                 .diagonal = true};
  c.process.decay_tau_s = 0.0;
  c.process.max_speed = c.process.max_accel = c.process.max_yaw_rate = c.process.max_yaw_accel = 0.0;
  c.gate.enabled = false;
  c.disagreement.enabled = false;
  c.adaptation.enabled = false;
  c.zero_velocity.enabled = false;
  c.odometries = {lidar(), thermal()};
  for (OdometrySensor& s : c.odometries) {
    s.odometry.relative_pose = false;
    s.odometry.fixed_noise = true;
    s.odometry.speed_fraction = 0.0;
  }
  c.odometries[1].odometry.sigma_speed = 0.3;
  return c;
}

Config Config::predecessor() {
  Config c = paper();
  c.process.noise = ProcessNoise{.jerk = 0.0,
                                 .yaw_jerk = 0.0,
                                 .accel = 1.0,
                                 .yaw_accel = 0.1,
                                 .position = 1e-4,
                                 .yaw = 1e-6,
                                 .scale = 0.0,
                                 .thermal_yaw_bias = 0.0,
                                 .thermal_delay = 0.0,
                                 .gyro_bias = 0.0,
                                 .accel_bias = 0.0,
                                 .diagonal = false};
  c.initial.sigma_accel = c.initial.sigma_yaw_accel = 0.0;
  c.initial.sigma_position = 5.0;
  c.initial.sigma_yaw = 0.5;
  c.gnss.enabled = true;
  return c;
}

Config Config::standard() {
  Config c;
  c.odometries = {lidar(), thermal()};
  OdometryConfig& t = c.odometries[1].odometry;
  t.calibration = {.scale = true, .yaw_bias = true, .delay = true};
  return c;
}

Result<void> check(const Config& c) {
  const auto wrong = [](const std::string& what) { return Error{ErrorCode::invalid_argument, what}; };
  std::set<std::string> names = {"imu", "gnss", "zero_velocity"};
  int relative = 0;
  for (const OdometrySensor& s : c.odometries) {
    if (s.name.empty() || !names.insert(s.name).second) return wrong("odometry '" + s.name + "': the name is taken");
    const OdometryConfig& o = s.odometry;
    if (!o.body_from_sensor.matrix().allFinite()) return wrong(s.name + ": the extrinsic calibration is not finite");
    if (!(o.sigma_speed > 0 && o.sigma_yaw_rate > 0 && o.sigma_position > 0 && o.sigma_yaw > 0)) {
      return wrong(s.name + ": deviations must be positive");
    }
    if (!(o.max_interval_s > 0)) return wrong(s.name + ": max_interval_s must be positive");
    relative += o.relative_pose ? 1 : 0;
  }
  if (relative > kScratchSlot) {
    return wrong("at most " + std::to_string(kScratchSlot) + " odometries can be fused as relative poses, " +
                 std::to_string(relative) + " are configured: set relative_pose to false for the others");
  }
  if (c.odometries.size() + 3 > static_cast<std::size_t>(kMaxSensors)) {
    return wrong("at most " + std::to_string(kMaxSensors - 3) + " odometries");
  }
  const ProcessNoise& n = c.process.noise;
  for (const double density : {n.jerk, n.yaw_jerk, n.accel, n.yaw_accel, n.position, n.yaw, n.scale, n.thermal_yaw_bias,
                               n.thermal_delay, n.gyro_bias, n.accel_bias}) {
    if (!(density >= 0.0) || !std::isfinite(density)) return wrong("noise densities must be zero or positive");
  }
  if (!(c.process.max_step_s > 0.0)) return wrong("max_step_s must be positive");
  if (!(c.replay.history_s > 0.0)) return wrong("history_s must be positive");
  const InitialState& i = c.initial;
  for (const double sigma : {i.sigma_position, i.sigma_yaw, i.sigma_speed, i.sigma_accel, i.sigma_yaw_rate,
                             i.sigma_yaw_accel, i.sigma_scale, i.sigma_thermal_yaw_bias, i.sigma_thermal_delay}) {
    if (!(sigma >= 0.0) || !std::isfinite(sigma)) return wrong("initial deviations must be zero or positive");
  }
  return {};
}

}  // namespace adit::state_estimator
