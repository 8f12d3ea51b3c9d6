// Scenario S0 of the specification: many runs of bounded truth with matched measurement noise, asynchronous and partly
// out of order; how often the normalized errors lie where chi-square says they must.
#pragma once

#include <vector>

#include "components/state_estimator/test_support.hpp"

namespace adit::state_estimator::test {

struct MonteCarloConfig {
  int runs = 100;
  int seconds = 600;
  bool calibration = false;                            // with thermal scale and yaw bias in truth and state (9 states)
  bool diagonal_noise = false;                         // the paper's process noise
  double out_of_order = 0.2;                           // share of thermal measurements delivered 50 ms late
  double lidar_sigma_v = 0.05, lidar_sigma_w = 0.002;  // 10 Hz
  double thermal_sigma_v = 0.3, thermal_sigma_w = 0.005;  // 30 Hz
};

struct MonteCarloResult {
  std::vector<double> nees;  // mean over the runs, one value a second
  double nees_mean = 0.0, pose_nees_mean = 0.0, motion_nees_mean = 0.0;
  double inside = 0.0;  // share of seconds whose mean lies in the two-sided 95 % band
  double nis_per_dof = 0.0;
  double yaw_rms_deg = 0.0, position_rms_m = 0.0;  // at the end
  double largest_autocorrelation = 0.0;            // of the LiDAR innovations, lags 1 to 10
  std::size_t updates = 0;
};

MonteCarloResult monte_carlo(const MonteCarloConfig& config);

}  // namespace adit::state_estimator::test
