// For tests and benchmarks only: sweeps of simple scenes with exact truth, by intersecting rays with boxes and a
// cylinder.
#pragma once

#include <functional>
#include <vector>

#include "components/geometry/se3.hpp"
#include "components/lidar_odometry/test_data.hpp"

namespace adit::lidar_odometry {

struct Box {
  Eigen::Vector3d low, high;
};

struct Scene {
  std::vector<Box> rooms;      // seen from inside
  std::vector<Box> solids;     // seen from outside
  double tunnel_radius = 0.0;  // > 0: a cylinder about the x axis, seen from inside, without end

  // Distance along a unit ray to the first surface; 0 if there is none within 120 m.
  double range(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) const;
};

// A furnished hall of 24 x 16 x 7 m around the origin: everything is observable.
Scene hall();
// A smooth tunnel of 4 m radius along x with floor and kerbs: only the position along it is not observable.
Scene smooth_tunnel();
// The same with boxes on the walls every few metres from x = first to x = last: observable there.
Scene furnished_tunnel(double first = -80.0, double last = 400.0);

struct ScannerModel {
  int rings = 32;
  int columns = 512;
  double vertical_fov = 0.7854;  // rad, symmetric
  double period = 0.1;           // s, of a revolution
  double noise = 0.02;           // m, standard deviation of the range
  bool times = true;
};

// A sweep that ends at `end` while moving with the constant twist [m/s; rad/s] (sensor frame). Organised, row by row;
// rays without return are NaN. The same arguments give the same sweep.
RecordedSweep scan(const Scene& scene, const ScannerModel& model, const Pose& end, const Vector6d& twist,
                   std::int64_t stamp_ns, unsigned seed);
// The same with any motion: pose_at(s after the stamp).
RecordedSweep scan(const Scene& scene, const ScannerModel& model, const std::function<Pose(double)>& pose_at,
                   std::int64_t stamp_ns, unsigned seed);

}  // namespace adit::lidar_odometry
