// The figures of an evaluation as JSON for scripts and as a table for people.
#pragma once

#include <span>
#include <string>

#include "bringup/evaluation/evaluation.hpp"
#include "idl/result.hpp"

namespace adit::evaluation {

// {"estimates": {NAME: {"ate_m", "rpe_10m_percent", "drift_percent", "yaw_end_deg", "scale", "availability",
// "frames", "axial_end_m", "lateral_end_m", "largest_gap_s", "nees", "sigma3_coverage", "cpu_s", "error_end_m":
// {"total", "yaw", "scale", "rest", "yaw_share"}}}, "distance_m", "duration_s"}; a figure that does not exist is null.
// Distance and duration are the truth's.
std::string summary_json(std::span<const Evaluation> evaluations);

// Writes summary_json to `path`. Errors: no evaluation, two of the same name, the system's reason.
Result<void> write_summary(const std::string& path, std::span<const Evaluation> evaluations);

// A table with one row an estimate, ready to print; "-" where a figure does not exist.
std::string print_table(std::span<const Evaluation> evaluations);

// Where the position errors come from (decomposition.hpp). Empty when there is nothing to decompose.
std::string print_decomposition_table(std::span<const Evaluation> evaluations);

// The drift by length of every estimate: one row a length and estimate. Empty when no length fits.
std::string print_drift_table(std::span<const Evaluation> evaluations);

}  // namespace adit::evaluation
