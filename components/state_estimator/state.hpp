// What the filter carries from one instant to the next. One trivially copyable value, so that a checkpoint is a copy
// and a replay cannot forget anything: estimate, covariance, pose clones, and each sensor's gate and window statistics.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include <Eigen/Core>

#include "components/state_estimator/noise_adaptation.hpp"

namespace adit::state_estimator {

// State vector. Position and heading in `odom`, motion of base_link; arXiv 2505.03565 eq. for x = [x y v v' psi psi'
// psi''], then calibration states, then cloned poses (x, y, psi) of earlier instants.
enum Index : int {
  kX,               // m
  kY,               // m
  kSpeed,           // m/s, forward, negative in reverse
  kAccel,           // m/s^2
  kYaw,             // rad, in (-pi, pi]
  kYawRate,         // rad/s
  kYawAccel,        // rad/s^2
  kScale,           // ln of (thermal length / true length)
  kThermalYawBias,  // rad/s, thermal yaw rate minus true yaw rate
  kThermalDelay,    // s, by which the thermal stamps are later than what they stamp
  kGyroBias,        // rad/s
  kAccelBias,       // m/s^2
  kFirstClone,
};
inline constexpr int kCoreStates = 7;
inline constexpr int kCloneSlots = 3;   // two relative-pose sensors and one for predictions
inline constexpr int kScratchSlot = 2;  // used by relative predictions only
inline constexpr int kStates = kFirstClone + 3 * kCloneSlots;
inline constexpr int kMaxSensors = 8;
inline constexpr std::int64_t kNoStamp = std::numeric_limits<std::int64_t>::min();

using StateVector = Eigen::Matrix<double, kStates, 1>;
using StateMatrix = Eigen::Matrix<double, kStates, kStates>;

inline constexpr int clone_index(int slot) {
  return kFirstClone + 3 * slot;
}
inline double square(double value) {
  return value * value;
}
inline double seconds_between(std::int64_t from_ns, std::int64_t to_ns) {
  return static_cast<double>(to_ns - from_ns) * 1e-9;
}

// Speed and yaw rate a sensor reported, averaged over the last half second: what the disagreement test compares.
struct MotionWindow {
  double speed = 0.0, speed_variance = 0.0;
  double yaw_rate = 0.0, yaw_rate_variance = 0.0;
  double suspicion = 0.0;  // the front end's own doubt, 0 none to 1 certain
  double surprise = 0.0;   // NIS per degree of freedom with the covariance as reported, recent mean: 1 is usual
  std::int64_t stamp_ns = kNoStamp;
  std::int64_t speed_stamp_ns = kNoStamp;  // last report with information along the heading
  std::int64_t zero_since_ns = kNoStamp;   // since when the sensor reports no motion at all
};

struct SensorState {
  std::int64_t last_accepted_ns = kNoStamp;
  std::int64_t last_received_ns = kNoStamp;
  std::uint64_t accepted = 0;       // fused, possibly down-weighted
  std::uint64_t rejected = 0;       // failed the gate
  std::uint64_t distrusted = 0;     // not used because another sensor shows it is wrong
  std::uint64_t unanchored = 0;     // relative to an instant the filter no longer holds
  std::uint64_t uninformative = 0;  // no direction carried information
  std::uint32_t consecutive_rejections = 0;
  std::uint32_t forced = 0;  // times the lock-out guard let it in again
  double nis = 0.0;          // of the last examined measurement
  int nis_dof = 0;
  double nis_per_dof_sum = 0.0;  // over all examined ones: the mean should be 1
  std::uint64_t examined = 0;
  bool is_distrusted = false;
  double log_scale_sigma = 0.0, least_log_scale_sigma = 0.0;  // of its lengths by its own account: last, least; 0: none
  NoiseAdaptation noise;
  MotionWindow window;
};

struct FilterState {
  std::int64_t stamp_ns = kNoStamp;
  StateVector x = StateVector::Zero();
  StateMatrix p = StateMatrix::Zero();
  std::array<std::int64_t, kCloneSlots> clone_stamp_ns = {kNoStamp, kNoStamp, kNoStamp};
  std::int64_t last_motion_ns = kNoStamp;  // last fused measurement of motion: outages count from here
  std::array<SensorState, kMaxSensors> sensors;
  std::int64_t conflict_since_ns = kNoStamp;   // two motion sensors disagree since
  std::int64_t agreement_since_ns = kNoStamp;  // and agree again since
  bool conflict = false;                       // persistent disagreement without an arbiter

  // Copies the pose and its correlations into a slot.
  void clone(int slot);
  void drop_clone(int slot);
};

}  // namespace adit::state_estimator
