// One event applied to one state: predict, examine, correct, account. No history, no clock: the same state and the same
// event give the same bits, which is what makes replay exact.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "components/state_estimator/health.hpp"
#include "components/state_estimator/measurement.hpp"
#include "components/state_estimator/process_model.hpp"

namespace adit::state_estimator {

struct Innovation;

struct GateConfig {
  bool enabled = true;
  bool robust = true;  // Huber weights between the 95 % and the 99.9 % quantile
  // After this many rejections in a row a sensor that nobody contradicts is let in again with a widened motion
  // covariance: it is then the filter that is wrong.
  std::uint32_t lockout_rejections = 8;
  double lockout_speed = 2.0;     // m/s, standard deviation given to the speed
  double lockout_yaw_rate = 0.5;  // rad/s
  // A sensor that reports no motion while the filter moves has to insist for this long.
  double zero_motion_patience_s = 2.0;
};

// What the filter needs to know of a sensor.
struct SensorModel {
  std::unique_ptr<const MeasurementModel> model;
  int clone_slot = -1;    // relative-pose sensors: where their anchor lives
  bool reanchor = false;  // and whether each measurement's end is the next one's start
  bool moves = false;     // reports motion: its silence is an outage, the disagreement test watches it
  bool scaled = false;    // its lengths carry kScale
  bool gated = true;
  bool adapts = false;      // its covariance is scaled by what its innovations show
  bool standstill = false;  // the zero-velocity detector
};

class Filter {
 public:
  ProcessConfig process;
  GateConfig gate;
  DisagreementConfig disagreement;
  NoiseAdaptationConfig adaptation;
  double scale_sigma = 0.1;  // of ln(scale) when a scaled sensor has measured its lengths anew

  // Index of the new sensor, or -1 when there are kMaxSensors already.
  int add_sensor(SensorModel sensor);
  const SensorModel& sensor(int index) const { return sensors_[static_cast<std::size_t>(index)]; }
  int sensor_count() const { return count_; }

  // Moves `state` to the measurement's stamp (never back) and applies it. Thread: any, const.
  void apply(FilterState& state, const Measurement& measurement) const;

 private:
  bool examine(FilterState& state, const Measurement& m, const SensorModel& sensor, Innovation& innovation) const;
  bool let_in_again(FilterState& state, const Measurement& m) const;
  bool stands(const FilterState& state) const;

  std::array<SensorModel, kMaxSensors> sensors_;
  int count_ = 0;
};

}  // namespace adit::state_estimator
