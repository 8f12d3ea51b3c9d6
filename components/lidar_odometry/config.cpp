#include "components/lidar_odometry/config.hpp"

#include <array>
#include <cmath>
#include <string>
#include <utility>

namespace adit::lidar_odometry {
namespace {

constexpr std::array<std::pair<Mode, std::string_view>, 3> names{
    {{Mode::kiss, "kiss"}, {Mode::genz, "genz"}, {Mode::default_, "default"}}};

struct Range {
  const char* name;
  double value, low, high;
};

}  // namespace

std::string_view to_string(Mode mode) {
  for (const auto& [candidate, name] : names) {
    if (candidate == mode) return name;
  }
  return "unknown";
}

std::optional<Mode> mode_from_string(std::string_view name) {
  for (const auto& [mode, candidate] : names) {
    if (candidate == name) return mode;
  }
  return std::nullopt;
}

Result<void> check(const Config& c) {
  const double unlimited = 1e9;
  const Range ranges[] = {
      {"min_range", c.min_range, 0.0, c.max_range},
      {"max_range", c.max_range, 1.0, 1000.0},
      {"threads", static_cast<double>(c.threads), 1.0, 64.0},
      {"min_points", static_cast<double>(c.min_points), 10.0, unlimited},
      {"max_gap_s", c.max_gap_s, 0.01, 3600.0},
      {"restart_after", static_cast<double>(c.restart_after), 1.0, unlimited},
      {"kiss.voxel_size", c.kiss.voxel_size, 0.0, 10.0},
      {"kiss.max_points_per_voxel", static_cast<double>(c.kiss.max_points_per_voxel), 1.0, 100.0},
      {"kiss.initial_threshold", c.kiss.initial_threshold, 1e-3, 100.0},
      {"kiss.min_motion", c.kiss.min_motion, 0.0, 100.0},
      {"kiss.max_iterations", static_cast<double>(c.kiss.max_iterations), 1.0, 10000.0},
      {"kiss.convergence", c.kiss.convergence, 1e-12, 1.0},
      {"genz.voxel_size", c.genz.voxel_size, 0.02, 10.0},
      {"genz.max_points_per_voxel", static_cast<double>(c.genz.max_points_per_voxel), 1.0, 100.0},
      {"genz.desired_points", static_cast<double>(c.genz.desired_points), 100.0, 1e6},
      {"genz.planarity", c.genz.planarity, 1e-6, 1.0},
      {"genz.initial_threshold", c.genz.initial_threshold, 1e-3, 100.0},
      {"genz.min_motion", c.genz.min_motion, 0.0, 100.0},
      {"genz.max_iterations", static_cast<double>(c.genz.max_iterations), 1.0, 10000.0},
      {"surfel.block_columns", static_cast<double>(c.surfel.block_columns), 0.0, 64.0},
      {"surfel.block_rows", static_cast<double>(c.surfel.block_rows), 0.0, 64.0},
      {"surfel.selection_cell", c.surfel.selection_cell, 0.02, 10.0},
      {"surfel.range_sigma", c.surfel.range_sigma, 0.0, 1.0},
      {"surfel.max_extent", c.surfel.max_extent, 0.05, 100.0},
      {"surfel.min_width", c.surfel.min_width, 1e-4, 1.0},
      {"surfel.planarity", c.surfel.planarity, 1e-3, 1.0},
      {"surfel.max_thickness", c.surfel.max_thickness, 1e-3, 1.0},
      {"surfel.cell_size", c.surfel.cell_size, 0.05, 10.0},
      {"surfel.map_radius", c.surfel.map_radius, 5.0, 1000.0},
      {"surfel.max_cells", static_cast<double>(c.surfel.max_cells), 1024.0, 1 << 24},
      {"surfel.residual_sigma", c.surfel.residual_sigma, 1e-4, 1.0},
      {"surfel.common_tilt", c.surfel.common_tilt, 0.0, 0.2},
      {"surfel.required_translation", c.surfel.required_translation, 1e-4, 10.0},
      {"surfel.required_rotation", c.surfel.required_rotation, 1e-5, 1.0},
      {"surfel.max_acceleration", c.surfel.max_acceleration, 0.01, 1000.0},
      {"surfel.max_angular_acceleration", c.surfel.max_angular_acceleration, 0.01, 1000.0},
      {"surfel.deskew_share", c.surfel.deskew_share, 0.0, 1.0},
      {"genz.convergence", c.genz.convergence, 1e-12, 1.0},
  };
  for (const Range& range : ranges) {
    if (!(range.value >= range.low && range.value <= range.high)) {
      return Error{ErrorCode::invalid_argument,
                   std::string("lidar odometry: ") + range.name + " = " + std::to_string(range.value) + " is not in [" +
                       std::to_string(range.low) + ", " + std::to_string(range.high) + "]"};
    }
  }
  if (to_string(c.mode) == "unknown") return Error{ErrorCode::invalid_argument, "lidar odometry: unknown mode"};
  return {};
}

}  // namespace adit::lidar_odometry
