// The evaluation as one HTML file: tables and plots, no script, no network, opens from disk anywhere.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "bringup/evaluation/evaluation.hpp"
#include "bringup/evaluation/fusion_log.hpp"
#include "bringup/evaluation/svg_plot.hpp"
#include "idl/result.hpp"

namespace adit::evaluation {

struct ReportOptions {
  std::string title = "Trajectory evaluation";
  std::string description;                                        // a paragraph: where, which sensors, which truth
  std::vector<std::pair<std::int64_t, std::int64_t>> outages_ns;  // shaded in plots over time
  std::vector<std::pair<std::string, std::string>> inputs;        // a table: sensors, rates, route, truth, ...
  std::vector<std::vector<Eigen::Vector2d>> map;  // walls seen from above: a plot, and behind the top view
  struct Picture {
    std::string caption, png;  // the file's bytes
  };
  std::vector<Picture> pictures;
  std::vector<FusionLog> fusion;  // innovations and modes of the filters
};

// Sections: inputs, figures, error decomposition, drift by length, map, top view, heading, position error over distance
// and over time, axial and lateral error, heading error, NEES, NIS and modes, pictures. Those without data are left
// out.
std::string report_html(const Trajectory& truth, std::span<const Evaluation> evaluations,
                        const ReportOptions& options = {});

// Writes report_html to `path`. Errors: no evaluation, the system's reason.
Result<void> write_report(const std::string& path, const Trajectory& truth, std::span<const Evaluation> evaluations,
                          const ReportOptions& options = {});

// The plots one by one, for callers that lay out their own page.
Plot top_view(const Trajectory& truth, std::span<const Evaluation> evaluations);
Plot map_with_route(const Trajectory& truth, const std::vector<std::vector<Eigen::Vector2d>>& map);
Plot nees_over_time(const Trajectory& truth, std::span<const Evaluation> evaluations);
Plot nis_over_time(const Trajectory& truth, const FusionLog& log);
Plot position_error_over_distance(std::span<const Evaluation> evaluations);
Plot position_error_over_time(const Trajectory& truth, std::span<const Evaluation> evaluations);
Plot heading_over_time(const Trajectory& truth, std::span<const Evaluation> evaluations);
Plot heading_error_over_time(const Trajectory& truth, std::span<const Evaluation> evaluations);
Plot tunnel_error_over_distance(std::span<const Evaluation> evaluations, bool axial);

}  // namespace adit::evaluation
