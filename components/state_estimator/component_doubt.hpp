// What the front ends say against themselves, as one number each: 0 nothing, 1 do not believe it (and the filter does
// not). When two sensors contradict each other, it helps to decide which one is wrong (health.hpp).
#pragma once

#include <cmath>
#include <cstdint>

#include "components/state_estimator/state.hpp"

namespace adit::adit_msgs::msg {
struct Localizability;
struct ThermalHealth;
}  // namespace adit::adit_msgs::msg

namespace adit::state_estimator {

// The latest word of a front end, valid for half a second.
struct Doubt {
  double value = 0.0;
  std::int64_t stamp_ns = kNoStamp;
  double at(std::int64_t stamp) const {
    return stamp_ns != kNoStamp && std::abs(seconds_between(stamp_ns, stamp)) < 0.5 ? value : 0.0;
  }
};

// Smoke and fog swallow returns: a sweep that matches less than half of what sweeps of late did is in doubt, one that
// matches nothing entirely.
class LidarDoubt {
 public:
  void update(const adit_msgs::msg::Localizability& message);
  const Doubt& doubt() const { return doubt_; }

 private:
  double usual_ = 0.0;  // correspondences of a sweep
  Doubt doubt_;
};

// State, residual and flags of the thermal odometry. After a blind gap it may have aligned the picture wrongly.
Doubt doubt_of(const adit_msgs::msg::ThermalHealth& message);

}  // namespace adit::state_estimator
