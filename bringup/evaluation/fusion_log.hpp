// What a filter said of itself while it ran, as fusion_status_writer wrote it.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "bringup/evaluation/evaluation.hpp"
#include "idl/result.hpp"

namespace adit::evaluation {

struct FusionLog {
  struct Sensor {
    std::string name;
    std::vector<StampedValue> innovations;  // NIS per degree of freedom of each examined measurement
    double mean_nis_per_dof = 0.0;
    std::uint64_t accepted = 0, rejected = 0, late = 0, dropped = 0;  // at the end
  };
  std::string name;
  std::array<double, 5> mode_s{};                         // by adit_msgs/FusionStatus' modes [s]
  double thermal_scale = 1.0, thermal_scale_sigma = 0.0;  // at the end
  std::vector<Sensor> sensors;
};

// Columns: stamp, mode, thermal_scale, thermal_scale_sigma, then of each sensor: name, nis, dof, nis_mean, accepted,
// rejected, late, dropped; separated by commas. Errors name file and line.
Result<FusionLog> read_fusion_log(const std::string& path);

// Lines for people.
std::vector<std::string> summary_of(const FusionLog& log);

}  // namespace adit::evaluation
