// Where a recorded drive was in a map made before: ground truth without a reference system (requirement R51). Each
// sweep is registered to the map's planes, then all of them and the odometry between are smoothed in one pose graph, in
// which a registration that does not fit is switched off. For offline use: it looks at the whole drive.
#pragma once

#include <memory>
#include <vector>

#include "components/mapping/plane_map.hpp"
#include "components/mapping/registration.hpp"

namespace adit::mapping {

class MapLocalizer {
 public:
  struct Config {
    double coarse_voxel = 1.2, fine_voxel = 0.5;  // m, of the planes
    // Residuals beyond them count little [m]: to find the start, to follow, and for the result.
    double start_kernel = 2.0, coarse_kernel = 0.8, fine_kernel = 0.15;
    double least_overlap = 0.5;  // below it a registration is not used
    double most_rms = 0.15;      // m
    // Of the odometry, one sigma of a way of 1 m (of d m: times sqrt(d)), and of a step by itself.
    double drift_translation = 0.01, drift_rotation = 0.0002;  // m, rad
    double step_translation = 0.003, step_rotation = 1e-4;     // m, rad
    Undistortion sweep;
  };

  // `start`: T_map_sensor at the end of the first sweep, known to about 1 m and 5 degrees.
  MapLocalizer(std::span<const Point> map, const Pose& start) : MapLocalizer(map, start, Config()) {}
  MapLocalizer(std::span<const Point> map, const Pose& start, const Config& config);

  // Sweeps in order; `odometry`: T_odom_sensor covering the sweep. False: left out (no odometry, no points, its end not
  // after the last one's).
  bool add(const Sweep& sweep, const Trajectory& odometry);

  struct Result {
    Trajectory poses;                 // T_map_sensor at the end of each sweep
    std::size_t registered = 0;       // sweeps whose registration is used
    std::size_t switched_off = 0;     // of these, found wrong by the smoothing
    double overlap = 0.0, rms = 0.0;  // means of the registrations used [1, m]
  };
  Result smoothed() const;

 private:
  struct Instant {
    std::int64_t stamp_ns = 0;
    Pose odom = Pose::Identity();  // T_odom_sensor
    Pose map = Pose::Identity();   // T_map_sensor, registered or predicted
    Registration registration;
    bool used = false;
  };
  Config config_;
  PlaneMap coarse_, fine_;
  Pose start_;
  Points cloud_;
  std::vector<Instant> instants_;
};

}  // namespace adit::mapping
