// Do the motion sensors agree, and if not, whom to believe? Works on averaged speeds and yaw rates, so that a slow lie
// (smoke that travels along, a tunnel that looks standing) shows as well as a jump.
#pragma once

#include <array>
#include <cstdint>

#include "components/state_estimator/measurement.hpp"
#include "components/state_estimator/state.hpp"

namespace adit::state_estimator {

struct DisagreementConfig {
  bool enabled = true;
  double window_s = 0.3;          // averaging time constant
  double fresh_s = 0.6;           // older windows are not compared
  double threshold = 10.83;       // chi-square, 1 degree of freedom, 99.9 %
  double persistence_s = 0.3;     // disagreement this long is a conflict
  double release_s = 1.0;         // agreement this long ends it
  double patience_s = 5.0;        // a distrusted sensor that is the only one left is believed again after this
  double speed_floor = 0.10;      // m/s, differences below mean nothing
  double speed_fraction = 0.05;   // of the speed, for scale errors not yet estimated
  double yaw_rate_floor = 0.03;   // rad/s
  double evidence_margin = 0.25;  // difference of the doubts that decides a conflict
  double surprise_ratio = 4.0;    // a sensor so much less expected than the one it contradicts is in doubt
  double zero_speed = 0.05;       // m/s, below: the sensor reports no motion
};

// Adds a report to a sensor's window. `speed_scale`: what to divide its speed by (the estimated thermal scale).
void observe_motion(FilterState& state, int sensor, std::int64_t stamp_ns, const Motion& motion, double speed_scale,
                    const DisagreementConfig& config);

// Adds the NIS of an examined measurement, with the covariance as reported: who departs from the motion so far?
void observe_surprise(MotionWindow& window, double nis_per_dof);

// Compares all fresh windows and updates conflict and distrust. `standing`: an IMU says the body stands still.
void judge(FilterState& state, std::int64_t stamp_ns, bool standing, const DisagreementConfig& config);

// True when the two sensors' windows contradict each other beyond their noise.
bool disagree(const MotionWindow& a, const MotionWindow& b, const DisagreementConfig& config);

// Factor on a sensor's measurement covariance during an undecided conflict (covariance union): 1 without one.
double conflict_inflation(const FilterState& state, int sensor, const DisagreementConfig& config);

}  // namespace adit::state_estimator
