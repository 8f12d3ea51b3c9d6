// A mission as the estimator's tests have it: two odometries, with latencies, of a ride on a circle.
#pragma once

#include <gtest/gtest.h>

#include <functional>

#include "components/state_estimator/test_support.hpp"

namespace adit::state_estimator::test {

inline std::unique_ptr<StateEstimator> make(const Config& config) {
  Result<std::unique_ptr<StateEstimator>> made = StateEstimator::create(config);
  EXPECT_TRUE(made) << (made ? "" : made.error().message);
  return std::move(*made);
}

inline OdometrySample sample(std::int64_t stamp, const Pose& pose) {
  OdometrySample s;
  s.stamp_ns = stamp;
  s.pose = pose;
  return s;
}

// A circle of 20 m radius at 2 m/s, seen by both odometries.
inline Pose on_circle(std::int64_t t) {
  const double angle = 0.1 * seconds_between(0, t);
  return planar(20.0 * std::sin(angle), 20.0 * (1.0 - std::cos(angle)), angle);
}

struct Mission {
  std::unique_ptr<StateEstimator> estimator;
  std::int64_t now = 0;
  std::function<bool(std::int64_t)> lidar = [](std::int64_t) { return true; };
  std::function<bool(std::int64_t)> thermal = [](std::int64_t) { return true; };
  double largest_jump = 0.0;
  int silent = 0;

  explicit Mission(const Config& config) : estimator(make(config)) { estimator->start(0); }

  void until(std::int64_t end) {
    std::optional<Estimate> last = estimator->estimate(now);
    while (now < end) {
      now += 10 * kMillisecond;
      if (now % (100 * kMillisecond) == 0 && lidar(now)) {
        estimator->add_odometry(0, sample(now - 50 * kMillisecond, on_circle(now - 50 * kMillisecond)), now);
      }
      if (now % (40 * kMillisecond) == 0 && thermal(now)) {
        estimator->add_odometry(1, sample(now - 20 * kMillisecond, on_circle(now - 20 * kMillisecond)), now);
      }
      const std::optional<Estimate> e = estimator->publish(now);
      if (!e || !e->pose.matrix().allFinite() || !e->pose_covariance.allFinite()) {
        ++silent;
        continue;
      }
      if (last) {
        const Pose step = last->pose.inverse() * e->pose;
        largest_jump = std::max(largest_jump, std::abs(step.translation().norm() - std::abs(e->speed) * 0.01));
      }
      last = e;
    }
  }
  double error() const { return (estimator->estimate(now)->pose.translation() - on_circle(now).translation()).norm(); }
};

}  // namespace adit::state_estimator::test
