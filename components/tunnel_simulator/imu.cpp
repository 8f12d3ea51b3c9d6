#include "components/tunnel_simulator/imu.hpp"

#include <cmath>

#include "components/tunnel_simulator/random.hpp"

namespace adit::tunnel_simulator {
namespace {

Eigen::Vector3d normal(const RandomStream& random, std::uint64_t index) {
  return {random.normal(3 * index), random.normal(3 * index + 1), random.normal(3 * index + 2)};
}

}  // namespace

Imu::Imu(const ImuConfig& config, std::uint64_t seed) : config_(config), seed_(seed) {
  const RandomStream random(seed, 301);
  gyro_bias_ = config.gyro_bias * normal(random, 0);
  accel_bias_ = config.accel_bias * normal(random, 1);
}

ImuSample Imu::sample(const std::function<Pose(double)>& pose, double time, std::uint64_t index) {
  constexpr double h = 1e-3;
  const Pose before = pose(time - h);
  const Pose now = pose(time);
  const Pose after = pose(time + h);
  const Eigen::Vector3d acceleration =
      (after.translation() - 2.0 * now.translation() + before.translation()) / (h * h) +
      Eigen::Vector3d(0, 0, kGravity);
  ImuSample out;
  out.stamp_ns = std::llround(time * 1e9);
  out.acceleration = now.linear().transpose() * acceleration;
  out.rate = so3_log(before.linear().transpose() * after.linear()) / (2.0 * h);
  if (!config_.noise) return out;
  const RandomStream random(seed_, 302, index);
  const double dt = 1.0 / config_.rate;
  out.rate += gyro_bias_ + config_.gyro_noise / std::sqrt(dt) * normal(random, 0);
  out.acceleration += accel_bias_ + config_.accel_noise / std::sqrt(dt) * normal(random, 1);
  gyro_bias_ += config_.gyro_walk * std::sqrt(dt) * normal(random, 2);
  accel_bias_ += config_.accel_walk * std::sqrt(dt) * normal(random, 3);
  return out;
}

}  // namespace adit::tunnel_simulator
