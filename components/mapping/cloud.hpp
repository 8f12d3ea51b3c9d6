// Points as the mapping reads, keeps and writes them.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "components/geometry/trajectory.hpp"

namespace adit::mapping {

struct Point {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // m
  float intensity = 0.0F;                              // as the sensor gives it; 0 if it gives none
};
using Points = std::vector<Point>;

// A sweep in the sensor's frame (x ahead, y left, z up), each point at its own firing time. The views are read during a
// call only.
struct Sweep {
  std::int64_t stamp_ns = 0;       // its start: zero of the point times
  std::span<const Point> points;   // points that are not finite, or (0,0,0), are skipped and counted
  std::span<const float> seconds;  // firing time after the stamp, of each point; empty: all at the stamp
};

// The points of a sweep as seen at one instant from `reference`, with the motion in between taken out.
// `poses`: T_odom_sensor; they must cover the sweep (interpolation at 16 instants of it). `range`: ]least, most[ [m].
// At most about `most_points` points, evenly thinned. Counts what is not finite or (0,0,0) in `invalid`.
// False: the poses do not cover the sweep, or the fields are of unequal size; `out` is empty then.
struct Undistortion {
  double min_range = 0.5;
  double max_range = 60.0;
  std::size_t most_points = 12'000;
};
bool undistort(const Sweep& sweep, const Trajectory& poses, const Pose& reference, const Undistortion& config,
               Points& out, std::size_t& invalid);

// Step that thins `size` points to about `most`. Odd: it does not keep to some columns of an organised cloud.
std::size_t odd_stride(std::size_t size, std::size_t most);

// Instant of the last point.
std::int64_t end_ns(const Sweep& sweep);
// Poses a little too short of an instant are taken for it: clocks are rounded, last points are left out.
constexpr std::int64_t instant_tolerance_ns = 2'000'000;
std::optional<Pose> pose_at(const Trajectory& poses, std::int64_t stamp_ns);

}  // namespace adit::mapping
