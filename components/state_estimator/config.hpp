// Everything that can be set, with units and defaults; the three modes are presets of it.
#pragma once

#include <string>
#include <vector>

#include "components/state_estimator/filter.hpp"
#include "components/state_estimator/imu_input.hpp"
#include "components/state_estimator/map_correction.hpp"
#include "components/state_estimator/odometry_input.hpp"
#include "components/state_estimator/replay_buffer.hpp"
#include "idl/result.hpp"

namespace adit::state_estimator {

enum class Role { lidar, thermal, other };  // which word of the output mode a motion sensor's health decides

struct OdometrySensor {
  std::string name;
  Role role = Role::other;
  OdometryConfig odometry;
  bool level = true;  // the odometry's own frame has its z axis up: roll and pitch come from its poses
};

struct ImuSensor {
  bool enabled = false;
  Pose body_from_sensor = Pose::Identity();
  bool use_acceleration = true;
  double sigma_yaw_rate = 0.01;     // rad/s, one sample
  double sigma_acceleration = 0.4;  // m/s^2, one sample: levelling error; the scatter of the last samples is added
  double max_yaw_rate = 20.0, max_acceleration = 160.0;  // beyond: not a measurement
  double yaw_rate_bias = 0.01, acceleration_bias = 0.1;  // initial deviations
  Tilt::Config tilt;
  StandstillDetector::Config standstill;
};

struct GnssSensor {
  bool enabled = false;
  Eigen::Vector2d lever_arm = Eigen::Vector2d::Zero();  // antenna in base_link, m
  double floor = 0.02;                                  // m, best deviation believed
  double max_sigma = 30.0;                              // m, worse fixes are not used
};

struct ZeroVelocityConfig {
  bool enabled = true;
  double period_s = 0.1;
  double sigma_speed = 0.01, sigma_yaw_rate = 0.001;
  double odometry_speed = 0.04, odometry_yaw_rate = 0.02;  // what the odometries may report meanwhile
};

struct InitialState {
  double x = 0.0, y = 0.0, yaw = 0.0, speed = 0.0;
  double sigma_position = 0.001, sigma_yaw = 1e-4;  // the start defines odom: an exact pose, but for its instant
  double sigma_speed = 1.0, sigma_accel = 1.0, sigma_yaw_rate = 0.2, sigma_yaw_accel = 0.5;
  double sigma_scale = 0.1, sigma_thermal_yaw_bias = 0.002, sigma_thermal_delay = 0.03;
};

struct Config {
  ProcessConfig process;
  GateConfig gate;
  DisagreementConfig disagreement;
  NoiseAdaptationConfig adaptation;
  ReplayConfig replay;
  InitialState initial;
  ZeroVelocityConfig zero_velocity;
  MapCorrection::Config map_correction;
  std::vector<OdometrySensor> odometries;
  ImuSensor imu;
  GnssSensor gnss;
  double future_tolerance_s = 0.1;  // stamps later than now by more than this are refused
  double clock_jump_s = 2.0;        // now moving back by more than this is another clock: the filter re-stamps itself
  double longest_silence_s = 60.0;  // after this the motion is forgotten, the pose kept
  // A correction that would move the published pose by more than this at once is let in over smoothing_s instead.
  double largest_jump_m = 0.02, largest_jump_rad = 0.005, smoothing_s = 0.4;  // smoothing_s 0: off
  double outage_s = 0.5;                                                      // a sensor silent for longer is out

  // arXiv 2505.03565: 7 states, fixed diagonal process noise and fixed measurement noise, (v, psi') from a LiDAR and a
  // thermal odometry, no gate, no calibration states, no decay.
  static Config paper();
  // Schichler 2025 (Sensors 25(7) 2032): constant velocity and turn rate, KISS-ICP and thermal odometry, GNSS.
  static Config predecessor();
  // White jerk, relative poses by cloning, gates, disagreement test, thermal scale and yaw bias, decaying outages.
  static Config standard();
};

// Names the first value that makes no sense.
Result<void> check(const Config& config);

}  // namespace adit::state_estimator
