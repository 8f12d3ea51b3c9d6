// What a sensor says and what the state predicts it to say. A new kind of sensor is one MeasurementModel and one entry
// in the configuration; the filter core does not change.
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "components/state_estimator/state.hpp"

namespace adit::state_estimator {

inline constexpr int kMaxRows = 3;

// Speed and yaw rate seen by a motion sensor, for the comparison between sensors.
struct Motion {
  bool valid = false;
  bool has_speed = false;                          // false: no information along the heading (degenerate tunnel)
  bool frozen = false;                             // the sensor repeated itself exactly
  double speed = 0.0, speed_variance = 0.0;        // m/s
  double yaw_rate = 0.0, yaw_rate_variance = 0.0;  // rad/s
  double suspicion = 0.0;                          // the front end's own doubt, 0 to 1
};

struct Measurement {
  enum class Kind : std::uint8_t { update, clone };  // clone: remember the pose at `stamp_ns` for later relative poses

  std::int64_t stamp_ns = kNoStamp;   // the instant it speaks about
  std::int64_t anchor_ns = kNoStamp;  // relative poses: the earlier instant
  std::uint8_t sensor = 0;
  Kind kind = Kind::update;
  std::uint8_t rows = 0;  // informative rows: projection * value, with covariance rows x rows
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
  Eigen::Matrix3d projection = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  double log_scale_sigma = 0.0;  // of a scaled sensor's lengths, by its own account; 0: not told
  Motion motion;
};

// The order of processing; total, so that arrival order cannot matter. A clone follows the update of the same instant.
bool processed_before(const Measurement& a, const Measurement& b);

// Value minus prediction and the derivative of the prediction; the first `size()` rows count.
struct Linearization {
  Eigen::Vector3d innovation = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, kMaxRows, kStates> jacobian = Eigen::Matrix<double, kMaxRows, kStates>::Zero();
};

class MeasurementModel {
 public:
  virtual ~MeasurementModel() = default;
  // Number of values, 1 to kMaxRows.
  virtual int size() const = 0;
  // Precondition: the state is at the measurement's stamp and, for relative poses, holds the anchor in its slot.
  // Angles in the innovation are wrapped. Pure: the same arguments give the same bits.
  virtual Linearization linearize(const FilterState& state, const Measurement& measurement) const = 0;
};

}  // namespace adit::state_estimator
