// Reading a cloud: validity, point times, range, motion compensation, voxel selection.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "components/geometry/trajectory.hpp"
#include "components/lidar_odometry/cloud.hpp"
#include "components/lidar_odometry/estimate.hpp"
#include "components/lidar_odometry/voxel_table.hpp"

namespace adit::lidar_odometry {

// Fields of equal size, and width * height is the size if organised.
bool consistent(const Cloud& cloud);

// Seconds after the stamp at which point i was measured. Precondition: the cloud has times.
double point_time(const Cloud& cloud, std::size_t i);

// Earliest and latest point time [s]; nothing if the cloud has no times or any is not finite or beyond 10 s (such times
// are not seconds of a sweep).
struct TimeSpan {
  double first = 0.0, last = 0.0;
};
std::optional<TimeSpan> time_span(const Cloud& cloud);

// Poses of the sensor within a sweep relative to its pose at a reference time: a table of transforms with linear
// blending between them (error < 0.1 mm at 200 km/h and 200 deg/s).
class SweepMotion {
 public:
  // No motion.
  SweepMotion() = default;
  // Under a constant twist [m/s; rad/s] in the sensor frame; times in seconds after the stamp.
  SweepMotion(const Vector6d& twist, TimeSpan span, double reference_time);
  // Through given poses of the sensor in any fixed frame, with constant twists between them. stamp_ns: of the cloud.
  // Precondition: follows(poses, stamp_ns, span).
  SweepMotion(std::span<const StampedPose> poses, std::int64_t stamp_ns, TimeSpan span, double reference_time);

  // The same motion with a constant velocity [m/s] more, in the sensor frame at the reference time.
  SweepMotion with_velocity(const Eigen::Vector3d& velocity) const;

  // Coordinates at the reference time of a point measured at `time`. Outside the span: as at its nearer end.
  Eigen::Vector3d compensate(const Eigen::Vector3d& point, double time) const;
  // The transform that does so, [R | t].
  using Affine = Eigen::Matrix<double, 3, 4>;
  Affine at(double time) const;
  bool moving() const { return moving_; }

 private:
  static constexpr int intervals = 128;
  std::array<Affine, intervals + 1> poses_;
  double first_ = 0.0;
  double inverse_step_ = 0.0;
  double reference_time_ = 0.0;
  bool moving_ = false;
};

// True if the poses are rigid motions, finite, in the order of their stamps and reach from the first to the last point
// of the sweep, to 1 ms.
bool follows(std::span<const StampedPose> poses, std::int64_t stamp_ns, TimeSpan span);

// Points of the cloud with a return in ]min_range, max_range[, compensated, in cloud order. Counts what it drops.
// The range test is on the compensated point, as in KISS-ICP.
void read_points(const Cloud& cloud, const SweepMotion& motion, double min_range, double max_range,
                 std::vector<Eigen::Vector3d>& points, ScanCounters& counters);

// The first point of each cell, in order.
void downsample(std::span<const Eigen::Vector3d> points, double voxel_size, VoxelFilter& filter,
                std::vector<Eigen::Vector3d>& selected);

}  // namespace adit::lidar_odometry
