// How a vehicle moves along its route: speed over time, and the body's motion on its wheels or legs.
#pragma once

#include <cstdint>
#include <vector>

#include "components/geometry/se3.hpp"
#include "components/tunnel_simulator/route.hpp"

namespace adit::tunnel_simulator {

enum class VehicleKind : std::uint8_t { car, legged };

// Something that happens when the vehicle comes by a place.
struct MotionEvent {
  double at = 0.0;        // distance along the route, laps counted on [m]
  double stop = 0.0;      // stand there for so long [s]
  double reverse = 0.0;   // then drive back so far, and on again [m]
  double speed = -1.0;    // from here on drive at this speed; < 0: unchanged [m/s]
  double braking = -1.0;  // ... slowing down this hard; < 0: as before [m/s2]
};

struct MotionConfig {
  VehicleKind kind = VehicleKind::car;
  double speed = 10.0;        // [m/s]
  double acceleration = 1.5;  // [m/s2]
  double braking = 2.0;       // [m/s2]
  double lateral = 2.0;       // limit of v^2 * curvature [m/s2]
  double standing = 1.0;      // before departure [s]
  double stride = 0.5;        // legged: distance of one gait cycle [m]
  double sway = 1.0;          // factor on all motion of the body relative to the route
  std::vector<MotionEvent> events;
};

class Motion {
 public:
  Motion() = default;
  // Plans `duration` seconds.
  Motion(const MotionConfig& config, const Route& route, double duration, std::uint64_t seed);

  // Pose of base_link (on the ground, x forward, z up) in the world at a time >= 0 [s]. Twice differentiable.
  Pose pose(double time) const;
  double distance(double time) const;  // along the route [m]
  double speed(double time) const;     // along the route, negative in reverse [m/s]
  double acceleration(double time) const;

 private:
  void plan(double duration);
  struct Basis {
    std::size_t index;
    double fraction;
  };
  Basis locate(double time) const;
  Pose car(double time, const RoutePoint& place) const;
  Pose legged(double time, double distance, const RoutePoint& place) const;

  MotionConfig config_;
  Route route_;
  std::uint64_t seed_ = 0;
  std::vector<double> speeds_;     // control values of a uniform cubic B-spline
  std::vector<double> distances_;  // its integral at the knots
};

}  // namespace adit::tunnel_simulator
