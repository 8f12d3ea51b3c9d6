#include "components/state_estimator/initial_state.hpp"

#include "components/geometry/se3.hpp"

namespace adit::state_estimator {

FilterState initial_state(const Config& config, std::int64_t stamp_ns) {
  const InitialState& initial = config.initial;
  FilterState s;
  s.stamp_ns = stamp_ns;
  s.x(kX) = initial.x;
  s.x(kY) = initial.y;
  s.x(kYaw) = wrap_angle(initial.yaw);
  s.x(kSpeed) = initial.speed;
  const auto sigma = [&](int index, double value) { s.p(index, index) = value * value; };
  sigma(kX, initial.sigma_position);
  sigma(kY, initial.sigma_position);
  sigma(kYaw, initial.sigma_yaw);
  sigma(kSpeed, initial.sigma_speed);
  sigma(kAccel, initial.sigma_accel);
  sigma(kYawRate, initial.sigma_yaw_rate);
  sigma(kYawAccel, initial.sigma_yaw_accel);
  // Calibration states live only where a sensor can show them.
  for (const OdometrySensor& o : config.odometries) {
    if (o.odometry.calibration.scale) sigma(kScale, initial.sigma_scale);
    if (o.odometry.calibration.yaw_bias) sigma(kThermalYawBias, initial.sigma_thermal_yaw_bias);
    if (o.odometry.calibration.delay) sigma(kThermalDelay, initial.sigma_thermal_delay);
  }
  if (config.imu.enabled) sigma(kGyroBias, config.imu.yaw_rate_bias);
  if (config.imu.enabled && config.imu.use_acceleration) sigma(kAccelBias, config.imu.acceleration_bias);
  return s;
}

FilterState without_motion(const FilterState& old, const Config& config, std::int64_t stamp_ns) {
  FilterState fresh = initial_state(config, stamp_ns);
  fresh.x(kSpeed) = 0.0;
  constexpr int kept[] = {kX, kY, kYaw, kScale, kThermalYawBias, kThermalDelay, kGyroBias, kAccelBias};
  for (const int i : kept) {
    fresh.x(i) = old.x(i);
    for (const int j : kept) fresh.p(i, j) = old.p(i, j);
  }
  for (std::size_t i = 0; i < old.sensors.size(); ++i) {
    SensorState& s = fresh.sensors[i];
    s = old.sensors[i];
    s.last_accepted_ns = s.last_received_ns = kNoStamp;
    s.window = MotionWindow{};
    s.is_distrusted = false;
    s.consecutive_rejections = 0;
  }
  return fresh;
}

}  // namespace adit::state_estimator
