// Settings of the LiDAR odometry. Plain values with defaults; lengths in metres, angles in radians unless a name says
// otherwise. Sources: [K] Vizzo et al., "KISS-ICP", RA-L 2023; [G] Lee et al., "GenZ-ICP", RA-L 2025.
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

#include "idl/result.hpp"

namespace adit::lidar_odometry {

enum class Mode {
  kiss,      // point-to-point registration as published [K]
  genz,      // joint point-to-plane and point-to-point registration as published [G]
  default_,  // "default": range-image surfels, honest about degeneracy
};

// "kiss", "genz", "default".
std::string_view to_string(Mode mode);
std::optional<Mode> mode_from_string(std::string_view name);

// Mode kiss [K].
struct KissConfig {
  double voxel_size = 0.0;  // of the local map; 0: max_range / 100
  std::size_t max_points_per_voxel = 20;
  double initial_threshold = 2.0;
  double min_motion = 0.1;  // deviations from the prediction below this do not change the threshold
  int max_iterations = 500;
  double convergence = 1e-4;  // norm of the 6-vector step
};

// Mode genz [G].
struct GenzConfig {
  double voxel_size = 0.25;  // of the local map, and first value of the adaptive one
  std::size_t max_points_per_voxel = 1;
  std::size_t desired_points = 2000;  // the adaptive voxel steers the registered points to this
  double planarity = 0.2;             // largest l3 / (l1 + l2 + l3) of a planar neighbourhood
  double initial_threshold = 2.0;
  double min_motion = 0.1;
  int max_iterations = 100;
  double convergence = 1e-4;
};

// Mode default. The sizes suit indoor rooms to road tunnels; noise figures come from the sensor's data sheet.
struct SurfelConfig {
  std::size_t block_columns = 0, block_rows = 0;  // pixels of an image block; 0: from the image size
  double selection_cell = 0.20;                   // one surfel in a cell of this size;
  std::size_t min_surfels = 1500;                 // with fewer than this, a half or a quarter of the size
  double range_sigma = 0.02;                      // m, noise of a range
  double max_extent = 1.5, min_width = 0.02;      // m, standard deviations along a surfel
  double planarity = 0.15;                        // largest ratio of variances, thickness to width
  double max_thickness = 0.0316;                  // m, standard deviation
  double cell_size = 0.4;                         // of the local map
  double map_radius = 80.0;
  std::size_t max_cells = 1u << 16;
  double residual_sigma = 0.015;                                    // m, expected for one surfel
  double common_tilt = 0.00436;                                     // rad, that all normals may share
  double required_translation = 0.03, required_rotation = 1.75e-3;  // sigma of an observable direction, m and rad
  double max_acceleration = 3.0;  // m/s^2, of the vehicle: width of the constant-velocity prior. Larger is safe,
  double max_angular_acceleration = 1.0;  // rad/s^2; smaller than the true one is not.
  double deskew_share = 0.7;              // of the estimated motion in the compensation, at each association
};

struct Config {
  Mode mode = Mode::default_;
  double min_range = 0.5;  // points outside ]min_range, max_range[ are dropped
  double max_range = 100.0;
  bool deskew = true;  // compensate the motion within the sweep if the cloud has point times
  int threads = 1;     // that process() works with, the caller's included; the result does not depend on it
  // Fewer usable points than this: Status::too_few_points.
  std::size_t min_points = 50;
  // Without an external prior a pause longer than this ends the constant-velocity prediction: the motion is taken as 0.
  double max_gap_s = 1.0;
  // After this many clouds in a row that did not match, the local map is dropped and started anew at the predicted
  // pose.
  int restart_after = 5;

  KissConfig kiss;
  GenzConfig genz;
  SurfelConfig surfel;
};

// Error (invalid_argument) naming the first setting that is out of its range.
Result<void> check(const Config& config);

}  // namespace adit::lidar_odometry
