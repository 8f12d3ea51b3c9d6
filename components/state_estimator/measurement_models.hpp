// The sensors the estimator comes with. Values and units stand at each class.
#pragma once

#include "components/geometry/se3.hpp"
#include "components/state_estimator/measurement.hpp"

namespace adit::state_estimator {

// Which calibration states a sensor's odometry carries.
struct OdometryCalibration {
  bool scale = false;     // lengths are true lengths times exp(x[kScale]) (monocular)
  bool yaw_bias = false;  // yaw rate is off by x[kThermalYawBias]
  bool delay = false;     // stamps are late by x[kThermalDelay]
};

// (v, psi') [m/s, rad/s]: the linear pseudo-measurement of arXiv 2505.03565, y = [v, psi'], optionally with scale.
class SpeedAndYawRate final : public MeasurementModel {
 public:
  explicit SpeedAndYawRate(OdometryCalibration calibration = {}) : calibration_(calibration) {}
  int size() const override { return 2; }
  Linearization linearize(const FilterState& state, const Measurement& m) const override;

 private:
  OdometryCalibration calibration_;
};

// (dx, dy, dpsi) [m, m, rad] of base_link from the anchor instant to the stamp, in the anchor's body axes: stochastic
// cloning after Roumeliotis and Burdick, "Stochastic cloning", ICRA 2002.
class PlanarRelativePose final : public MeasurementModel {
 public:
  explicit PlanarRelativePose(int clone_slot, OdometryCalibration calibration = {})
      : slot_(clone_slot), calibration_(calibration) {}
  int size() const override { return 3; }
  Linearization linearize(const FilterState& state, const Measurement& m) const override;

 private:
  int slot_;
  OdometryCalibration calibration_;
};

// Levelled yaw rate [rad/s] of a gyroscope, psi' + bias.
class GyroYawRate final : public MeasurementModel {
 public:
  int size() const override { return 1; }
  Linearization linearize(const FilterState& state, const Measurement& m) const override;
};

// (levelled yaw rate, levelled forward acceleration) [rad/s, m/s^2] of an IMU at `lever_arm` (body axes, m) from
// base_link: a + bias - yaw_accel * y - yaw_rate^2 * x.
class ImuYawRateAndAcceleration final : public MeasurementModel {
 public:
  explicit ImuYawRateAndAcceleration(const Eigen::Vector2d& lever_arm) : lever_arm_(lever_arm) {}
  int size() const override { return 2; }
  Linearization linearize(const FilterState& state, const Measurement& m) const override;

 private:
  Eigen::Vector2d lever_arm_;
};

// Antenna position (x, y) [m] in odom, at `lever_arm` in body axes.
class GnssPosition final : public MeasurementModel {
 public:
  explicit GnssPosition(const Eigen::Vector2d& lever_arm) : lever_arm_(lever_arm) {}
  int size() const override { return 2; }
  Linearization linearize(const FilterState& state, const Measurement& m) const override;

 private:
  Eigen::Vector2d lever_arm_;
};

// Forward speed [m/s] of a wheel encoder or a radar.
class Speed final : public MeasurementModel {
 public:
  int size() const override { return 1; }
  Linearization linearize(const FilterState& state, const Measurement& m) const override;
};

// "It stands": (v, psi') = 0 with the detector's deviations.
class ZeroVelocity final : public MeasurementModel {
 public:
  int size() const override { return 2; }
  Linearization linearize(const FilterState& state, const Measurement& m) const override;
};

}  // namespace adit::state_estimator
