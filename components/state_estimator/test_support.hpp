// Shared by the tests and the benchmark of this folder: a bounded random drive and sensors with matched noise.
#pragma once

#include <cmath>
#include <random>

#include "components/geometry/se3.hpp"
#include "components/state_estimator/state_estimator.hpp"

namespace adit::state_estimator::test {

inline constexpr std::int64_t kMillisecond = 1'000'000;
inline constexpr std::int64_t kSecond = 1'000'000'000;

// Truth with mean-reverting acceleration (localization_spec.md 2.8: a free integrator would run away), integrated with
// 2 ms steps: a' = -a/2 - 0.15 (v - v0) + w, alpha' = -alpha - 0.5 omega + w.
class Drive {
 public:
  struct Config {
    double speed = 10.0, jerk = 0.5, yaw_jerk = 0.002;
  };
  Drive(const Config& config, std::uint64_t seed) : config_(config), random_(seed) { x_(kSpeed) = config.speed; }

  void advance_to(std::int64_t stamp_ns) {
    while (stamp_ns_ < stamp_ns) {
      const std::int64_t end = std::min(stamp_ns, stamp_ns_ + 2 * kMillisecond);
      const double dt = seconds_between(stamp_ns_, end);
      const CoreVector before = x_;
      x_ = transition(before, dt);
      x_(kAccel) += dt * (-0.5 * before(kAccel) - 0.15 * (before(kSpeed) - config_.speed)) +
                    std::sqrt(config_.jerk * dt) * normal_(random_);
      x_(kYawAccel) +=
          dt * (-before(kYawAccel) - 0.5 * before(kYawRate)) + std::sqrt(config_.yaw_jerk * dt) * normal_(random_);
      stamp_ns_ = end;
    }
  }
  const CoreVector& state() const { return x_; }
  std::int64_t stamp_ns() const { return stamp_ns_; }
  double noise() { return normal_(random_); }
  std::mt19937_64& random() { return random_; }

 private:
  Config config_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  CoreVector x_ = CoreVector::Zero();
  std::int64_t stamp_ns_ = 0;
};

// A (v, psi') measurement with given deviations.
inline Measurement rates(int sensor, std::int64_t stamp_ns, double speed, double yaw_rate, double sigma_speed,
                         double sigma_yaw_rate) {
  Measurement m;
  m.sensor = static_cast<std::uint8_t>(sensor);
  m.stamp_ns = stamp_ns;
  m.rows = 2;
  m.value << speed, yaw_rate, 0.0;
  m.covariance = Eigen::Vector3d(sigma_speed * sigma_speed, sigma_yaw_rate * sigma_yaw_rate, 1.0).asDiagonal();
  m.motion = {.valid = true,
              .has_speed = true,
              .frozen = false,
              .speed = speed,
              .speed_variance = sigma_speed * sigma_speed,
              .yaw_rate = yaw_rate,
              .yaw_rate_variance = sigma_yaw_rate * sigma_yaw_rate,
              .suspicion = 0.0};
  return m;
}

inline Pose planar(double x, double y, double heading) {
  Pose pose = Pose::Identity();
  pose.linear() = so3_exp({0.0, 0.0, heading});
  pose.translation() = Eigen::Vector3d(x, y, 0.0);
  return pose;
}

inline Pose planar(const CoreVector& x) {
  return planar(x(kX), x(kY), x(kYaw));
}

}  // namespace adit::state_estimator::test
