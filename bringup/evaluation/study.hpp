// Many runs (scenarios times seeds) in one table: medians and the worst.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "bringup/evaluation/evaluation.hpp"
#include "bringup/evaluation/outage_growth.hpp"

namespace adit::evaluation {

// The figures of one estimate in one run.
struct StudyRow {
  std::string scenario, estimate;
  std::uint64_t seed = 0;
  double distance_m = 0.0;
  std::optional<double> drift_percent, axial_percent, lateral_end_m, yaw_end_deg, ate_m, scale, nees, sigma3_coverage;
  std::vector<OutageGrowth> outages;
  double availability = 0.0, largest_gap_s = 0.0;
};

StudyRow study_row(const std::string& scenario, std::uint64_t seed, const Evaluation& evaluation,
                   std::span<const std::pair<std::int64_t, std::int64_t>> outages_ns = {});

// One row a scenario and estimate, in the order they come: medians over the seeds, the worst in brackets where it
// matters.
std::string print_study(const std::vector<StudyRow>& rows);

// All rows: {"runs": [{"scenario", "seed", "estimate", ...}]}.
std::string study_json(const std::vector<StudyRow>& rows);

// The middle value (mean of the two middle ones); nothing of nothing.
std::optional<double> median(std::vector<double> values);

}  // namespace adit::evaluation
