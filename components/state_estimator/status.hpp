// What the estimator says of itself and of its sensors.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "components/state_estimator/state.hpp"

namespace adit::state_estimator {

enum class Mode { initializing, fused, lidar, thermal, other, dead_reckoning };
const char* to_string(Mode mode);

struct SensorReport {
  std::string name;
  bool healthy = false;  // fused something within outage_s and not distrusted
  bool distrusted = false;
  double age_s = -1.0;        // since the last fused measurement; negative: never
  double nis = 0.0;           // of the last examined measurement,
  int nis_dof = 0;            // with so many rows
  double noise_factor = 1.0;  // on its covariance, found by its innovations
  double suspicion = 0.0;     // its front end's own doubt, recent mean: 0 none to 1 certain
  double mean_nis_per_dof = 0.0;
  std::uint64_t accepted = 0, rejected = 0, distrusted_count = 0, unanchored = 0, uninformative = 0, forced = 0;
  std::uint64_t too_old = 0, duplicates = 0, future = 0, malformed = 0, gaps = 0, jumps = 0;
};

struct Status {
  Mode mode = Mode::initializing;
  bool conflict = false;
  double thermal_scale = 1.0, thermal_scale_sigma = 0.0;
  double thermal_delay = 0.0, thermal_delay_sigma = 0.0;  // s
  std::uint64_t clock_jumps = 0, forgotten_motions = 0, replays = 0;
  std::uint64_t closures = 0, closures_rejected = 0;
  std::vector<SensorReport> sensors;
};

// Of one sensor, from the filter's state; not the counts of what never reached the filter.
SensorReport report_of(const std::string& name, const SensorState& state, std::int64_t now_ns, double outage_s);

}  // namespace adit::state_estimator
