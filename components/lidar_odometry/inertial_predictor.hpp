// The motion of the LiDAR between and within sweeps from an IMU: what a constant velocity cannot tell of a walking
// robot.
//
// A filter in the frame of the last pose (robocentric: Huai, Huang, "Robocentric visual-inertial odometry", IJRR 2022;
// preintegration between poses: Forster et al., "On-manifold preintegration", T-RO 2017): velocity, gravity and
// gyroscope bias, corrected by what the registration found of the motion between two sweeps. Nothing in it is absolute,
// so a drift of the odometry does it no harm. The accelerometer's bias is part of the gravity.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "components/geometry/stamped_ring.hpp"
#include "components/lidar_odometry/estimate.hpp"
#include "components/lidar_odometry/lidar_odometry.hpp"

namespace adit::lidar_odometry {

struct InertialConfig {
  Pose lidar_from_imu = Pose::Identity();  // coordinates in the IMU's frame to the LiDAR's
  // Densities of the white noise; the defaults are those of a small MEMS IMU inside a LiDAR.
  double gyro_noise = 3e-4;   // rad/s/sqrt(Hz)
  double accel_noise = 3e-3;  // m/s^2/sqrt(Hz)
  double gyro_bias = 0.02;    // rad/s, sigma at the start
  double gyro_walk = 1e-4;    // rad/s^2/sqrt(Hz)
  double accel_walk = 0.02;   // m/s^3/sqrt(Hz): the bias turns with the sensor
  // What no IMU is better than over one sweep: mounting, stamps, scale.
  double least_translation = 1e-3, least_rotation = 3e-4;  // m, rad
  double max_extrapolation_s = 0.02;                       // before the first and after the last sample
  double max_gap_s = 0.05;                                 // between samples
};

// Of the IMU, in its own frame.
struct InertialSample {
  std::int64_t stamp_ns = 0;
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();          // rad/s
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  // specific force, m/s^2: +9.81 upwards at rest
};

struct InertialCounters {
  std::uint64_t samples = 0;
  std::uint64_t refused = 0;       // not finite, beyond any IMU, or not later than the last one
  std::uint64_t predicted = 0;     // sweeps
  std::uint64_t uncovered = 0;     // sweeps that the samples do not reach over or have a gap in
  std::uint64_t contradicted = 0;  // sweeps whose registration disagreed; after a few the IMU is left out for a while
};

// Order of use, for each cloud: add() all samples up to its last point (later ones are not looked at, so that it does
// not matter whether they have come), predict(), LidarOdometry::process() with that prior, correct() with the estimate.
// No allocation after construction. Not thread-safe.
class InertialPredictor {
 public:
  explicit InertialPredictor(const InertialConfig& config = {});

  // False: refused. A few refused ones that follow each other are believed to be a new time base.
  bool add(const InertialSample& sample);
  // As after construction, counters excepted.
  void clear();

  // The prior of a sweep, with the poses within it; nothing if the samples do not tell. Its span is valid until the
  // next call. Of the first two sweeps the velocity is open: what turns and accelerates is known, and the second one's
  // prior hardly holds its position.
  std::optional<Prior> predict(const SweepStamps& sweep);
  // What became of the sweep; without a prediction, too.
  void correct(const Estimate& estimate);

  const InertialCounters& counters() const { return counters_; }
  bool empty() const { return samples_.empty(); }
  // Of the newest sample, and when the next one is to be expected. Precondition: !empty().
  std::int64_t newest_ns() const { return samples_.newest().stamp_ns; }
  std::int64_t next_ns() const {
    return samples_.size() < 2 ? newest_ns() : 2 * newest_ns() - samples_[samples_.size() - 2].stamp_ns;
  }

 private:
  static constexpr std::size_t capacity = 2048;  // 2 s at 1 kHz
  static constexpr int states = 15;
  using Covariance = Eigen::Matrix<double, states, states>;

  // Of the IMU, in the IMU's frame at the last pose.
  struct State {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  // since the last pose
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
    Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  // acceleration of free fall
    Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();
    // Of the errors [position, rotation (right), velocity, gravity, bias].
    Covariance covariance = Covariance::Zero();
  };

  bool covers(std::int64_t from_ns, std::int64_t to_ns) const;
  InertialSample reading(std::int64_t stamp_ns) const;
  void advance(State& state, std::int64_t from_ns, std::int64_t to_ns, bool with_covariance) const;
  State at_rest(std::int64_t stamp_ns) const;
  void set_velocity(State& state, const Vector6d& lidar_twist) const;
  void rebase(State& state) const;
  void sample_sweep(const SweepStamps& sweep);
  Matrix6d sweep_covariance(const SweepStamps& sweep) const;
  void note_surprise(const Vector6d& found, const Matrix6d& expected, double elapsed);
  bool contradicts(const Vector6d& found, const Matrix6d& expected);

  InertialConfig config_;
  StampedRing<InertialSample> samples_{capacity};
  std::size_t usable_ = 0;  // of the count, not after the sweep that is predicted
  std::int64_t refused_stamp_ = 0;
  int refused_in_a_row_ = 0;

  std::optional<State> state_;      // at last_ns_
  std::optional<State> predicted_;  // at the reference of the sweep asked for last
  std::int64_t last_ns_ = 0;
  Pose last_pose_ = Pose::Identity();   // of the LiDAR in the odometry
  std::optional<Vector6d> last_twist_;  // of the LiDAR, from two registered sweeps
  int contradictions_in_a_row_ = 0;
  std::int64_t silent_until_ns_ = 0;
  // Mean square of what the last motions found differed from those expected, as twists [(m/s)^2, (rad/s)^2].
  Vector6d surprise2_ = Vector6d::Zero();
  int surprises_ = 0;               // that are in it
  std::vector<StampedPose> poses_;  // within the sweep
  InertialCounters counters_;
};

}  // namespace adit::lidar_odometry
