// Inertial measurement unit: specific force and angular rate of a motion, with bias, bias walk and white noise.
#pragma once

#include <cstdint>
#include <functional>

#include "components/geometry/se3.hpp"

namespace adit::tunnel_simulator {

struct ImuConfig {
  double rate = 200.0;         // [Hz]
  double gyro_noise = 8.7e-5;  // density [rad/s/sqrt(Hz)]: 0.3 deg/sqrt(h)
  double gyro_bias = 5e-5;     // turn-on, rms [rad/s]: 10 deg/h
  double gyro_walk = 2e-6;     // [rad/s^2/sqrt(Hz)]
  double accel_noise = 1e-3;   // density [m/s^2/sqrt(Hz)]
  double accel_bias = 0.03;    // turn-on, rms [m/s^2]
  double accel_walk = 2e-5;    // [m/s^3/sqrt(Hz)]
  bool noise = true;
};

struct ImuSample {
  std::int64_t stamp_ns = 0;
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  // specific force in the sensor frame: +9.81 on z at rest
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();          // [rad/s]
};

constexpr double kGravity = 9.80665;

// Samples must be taken in order: biases walk from one to the next.
class Imu {
 public:
  Imu(const ImuConfig& config, std::uint64_t seed);
  const ImuConfig& config() const { return config_; }
  // `pose`: world <- imu, twice differentiable around time.
  ImuSample sample(const std::function<Pose(double)>& pose, double time, std::uint64_t index);

 private:
  ImuConfig config_;
  std::uint64_t seed_;
  Eigen::Vector3d gyro_bias_, accel_bias_;
};

}  // namespace adit::tunnel_simulator
