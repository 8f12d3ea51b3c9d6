// The motion of the camera between two instants as another odometry of the body tells it: what a tracker starts from.
#pragma once

#include <cstdint>
#include <optional>

#include "components/geometry/stamped_ring.hpp"
#include "components/thermal_odometry/frame.hpp"

namespace adit::thermal_odometry {

// One message of the body's odometry.
struct BodyMotion {
  std::int64_t stamp_ns = 0;
  Pose pose = Pose::Identity();                // body in its odometry frame
  Vector6d twist = Vector6d::Zero();           // body axes, [m/s, rad/s]
  Vector6d twist_variance = Vector6d::Zero();  // not in (0, 1e5): unknown
};

// Keeps the last two seconds or so. No allocation after construction.
class PriorMotion {
 public:
  struct Config {
    Pose body_from_camera = Pose::Identity();
    double max_extrapolation_s = 0.2;  // beyond the newest message, by its twist
    double max_gap_s = 0.2;            // between the messages an instant is interpolated from
    double usual_speed_sigma = 0.3;    // m/s, where the message does not say
    double usual_rate_sigma = 0.05;    // rad/s
  };
  explicit PriorMotion(const Config& config) : config_(config) {}

  // False: not finite, or not newer than the last one.
  bool add(const BodyMotion& motion);
  void clear() { samples_.clear(); }
  // Motion of the camera from one stamp to the other; its deviations grow with the time between.
  std::optional<Prior> between(std::int64_t from_ns, std::int64_t to_ns) const;

 private:
  std::optional<Pose> at(std::int64_t stamp_ns) const;

  Config config_;
  StampedRing<BodyMotion> samples_{256};
};

}  // namespace adit::thermal_odometry
