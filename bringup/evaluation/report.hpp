// The evaluation as one HTML file: tables and plots, no script, no network, opens from disk anywhere.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "bringup/evaluation/evaluation.hpp"
#include "bringup/evaluation/svg_plot.hpp"
#include "idl/result.hpp"

namespace adit::evaluation {

struct ReportOptions {
  std::string title = "Trajectory evaluation";
  std::string description;                                        // a paragraph: where, which sensors, which truth
  std::vector<std::pair<std::int64_t, std::int64_t>> outages_ns;  // shaded in plots over time
};

// Sections: figures, drift by length, top view, position error over distance and over time, axial and lateral error,
// heading and heading error.
std::string report_html(const Trajectory& truth, std::span<const Evaluation> evaluations,
                        const ReportOptions& options = {});

// Writes report_html to `path`. Errors: no evaluation, the system's reason.
Result<void> write_report(const std::string& path, const Trajectory& truth, std::span<const Evaluation> evaluations,
                          const ReportOptions& options = {});

// The plots one by one, for callers that lay out their own page.
Plot top_view(const Trajectory& truth, std::span<const Evaluation> evaluations);
Plot position_error_over_distance(std::span<const Evaluation> evaluations);
Plot position_error_over_time(const Trajectory& truth, std::span<const Evaluation> evaluations);
Plot heading_over_time(const Trajectory& truth, std::span<const Evaluation> evaluations);
Plot heading_error_over_time(const Trajectory& truth, std::span<const Evaluation> evaluations);
Plot tunnel_error_over_distance(std::span<const Evaluation> evaluations, bool axial);

}  // namespace adit::evaluation
