// How the state moves on by itself: constant acceleration and yaw acceleration through the third-order Taylor map of
// arXiv 2505.03565, noise by white jerk, a decaying acceleration when no measurement comes.
#pragma once

#include <cstdint>

#include "components/state_estimator/state.hpp"

namespace adit::state_estimator {

// Spectral densities of the white noises. Zero switches a term off. Those of the accelerations are a car's: with the
// decay below they let the acceleration be 2.2 m/s^2 and the yaw acceleration 0.12 rad/s^2 (sqrt(density * tau / 2)),
// brakes and bends included, which is what the covariance of an outage has to cover.
struct ProcessNoise {
  double jerk = 10.0;               // m^2/s^5, on the acceleration
  double yaw_jerk = 0.03;           // rad^2/s^5, on the yaw acceleration
  double accel = 0.0;               // m^2/s^3, on the speed (constant-velocity model; slip)
  double yaw_accel = 0.0;           // rad^2/s^3, on the yaw rate
  double position = 0.0;            // m^2/s, on x and y (lateral motion, planar mismatch)
  double yaw = 0.0;                 // rad^2/s, on the heading
  double scale = 1e-8;              // 1/s, on ln(scale)
  double thermal_yaw_bias = 1e-10;  // rad^2/s^3
  double thermal_delay = 1e-8;      // s
  double gyro_bias = 1e-10;         // rad^2/s^3
  double accel_bias = 1e-7;         // m^2/s^5
  // The paper's form: one fixed diagonal, scaled by the step only; no cross terms between s, v, a or psi, omega, alpha.
  bool diagonal = false;
};

struct ProcessConfig {
  ProcessNoise noise;
  double max_step_s = 0.05;  // the Taylor map's error stays below 10 um up to here at 100 km/h
  double hold_s = 0.7;       // time without motion measurements after which the accelerations decay,
  double decay_tau_s = 1.0;  // with this time constant (Singer); 0: never, the paper's model
  // Soft limits, applied as weak pseudo-measurements: a free double integrator runs away. 0: none.
  double max_speed = 60.0, max_accel = 12.0, max_yaw_rate = 4.0, max_yaw_accel = 30.0;
};

using CoreVector = Eigen::Matrix<double, kCoreStates, 1>;
using CoreMatrix = Eigen::Matrix<double, kCoreStates, kCoreStates>;

// One step of T seconds. `decay_tau` > 0: accelerations fall off as exp(-t / tau). Heading wrapped.
CoreVector transition(const CoreVector& x, double step, double decay_tau = 0.0);
// Its exact Jacobian.
CoreMatrix transition_jacobian(const CoreVector& x, double step, double decay_tau = 0.0);
// Covariance of what the white noises add during the step.
CoreMatrix process_noise(const CoreVector& x, double step, const ProcessNoise& noise);

// Moves estimate and covariance to a later instant, in steps of at most max_step_s. Nothing happens for earlier ones.
void predict(FilterState& state, std::int64_t to_ns, const ProcessConfig& config);

}  // namespace adit::state_estimator
