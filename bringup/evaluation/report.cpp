#include "bringup/evaluation/report.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <numbers>

#include "bringup/evaluation/summary.hpp"

namespace adit::evaluation {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;

double since_start(const Trajectory& truth, std::int64_t stamp_ns) {
  return truth.empty() ? 0.0 : static_cast<double>(stamp_ns - truth.front().stamp_ns) * 1e-9;
}

template <class Point>
void add_lines(Plot& plot, std::span<const Evaluation> evaluations, Point point) {
  for (const Evaluation& e : evaluations) {
    PlotLine& line = plot.lines.emplace_back();
    line.label = e.name;
    for (const Sample& s : e.samples) line.points.push_back(point(s));
  }
}

// The truth's headings without the jumps at +-180 degrees.
std::vector<double> unwrapped_headings(const Trajectory& truth) {
  std::vector<double> headings;
  for (const StampedPose& p : truth) {
    const double heading = yaw(p.pose.linear());
    headings.push_back(headings.empty() ? heading : headings.back() + wrap_angle(heading - headings.back()));
  }
  return headings;
}

std::string preformatted(const std::string& text);

std::string base64(const std::string& bytes) {
  static constexpr char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t n = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      word = word << 8 | (k < n ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) out += k <= n ? digits[word >> (18 - 6 * k) & 63U] : '=';
  }
  return out;
}

std::string inputs_table(const ReportOptions& options) {
  if (options.inputs.empty()) return {};
  std::string out = "<h2>Inputs</h2>\n<table>\n";
  for (const auto& [what, is] : options.inputs) {
    out += "<tr><th>" + escape_html(what) + "</th><td>" + escape_html(is) + "</td></tr>\n";
  }
  return out + "</table>\n";
}

// Share of the time in each mode, and the sensors' counts.
std::string fusion_table(const ReportOptions& options) {
  std::string out;
  for (const FusionLog& log : options.fusion) {
    for (const std::string& line : summary_of(log)) out += log.name + ": " + line + "\n";
  }
  return out.empty() ? out : "<h2>What the filters did</h2>\n" + preformatted(out);
}

std::string preformatted(const std::string& text) {
  return "<pre>" + escape_html(text) + "</pre>\n";
}

}  // namespace

Plot top_view(const Trajectory& truth, std::span<const Evaluation> evaluations) {
  Plot plot;
  plot.title = "Top view";
  plot.x_label = "x [m]";
  plot.y_label = "y [m]";
  plot.equal_axes = true;
  plot.first_is_truth = true;
  plot.height_px = 620;
  plot.lines.push_back({"truth", {}});
  for (const StampedPose& p : truth) plot.lines[0].points.push_back(p.pose.translation().head<2>());
  add_lines(plot, evaluations, [](const Sample& s) { return Eigen::Vector2d(s.estimate.translation().head<2>()); });
  return plot;
}

Plot map_with_route(const Trajectory& truth, const std::vector<std::vector<Eigen::Vector2d>>& map) {
  Plot plot;
  plot.title = "Map and route";
  plot.x_label = "x [m]";
  plot.y_label = "y [m]";
  plot.equal_axes = true;
  plot.background = map;
  plot.whole_background = true;
  plot.first_is_truth = true;
  plot.height_px = 520;
  plot.lines.push_back({"route driven", {}});
  for (const StampedPose& p : truth) plot.lines[0].points.push_back(p.pose.translation().head<2>());
  return plot;
}

Plot nees_over_time(const Trajectory& truth, std::span<const Evaluation> evaluations) {
  Plot plot;
  plot.title = "NEES of x, y, heading (3 when the covariance is right; 16.3 is the 99.9 % quantile)";
  plot.x_label = "time [s]";
  plot.y_label = "NEES";
  for (const Evaluation& e : evaluations) {
    if (e.nees.empty()) continue;
    PlotLine& line = plot.lines.emplace_back();
    line.label = e.name;
    for (const StampedValue& v : e.nees) line.points.emplace_back(since_start(truth, v.stamp_ns), v.value);
  }
  return plot;
}

Plot nis_over_time(const Trajectory& truth, const FusionLog& log) {
  Plot plot;
  plot.title = "NIS per degree of freedom, mean over a second: " + log.name + " (1 when the noise is right)";
  plot.x_label = "time [s]";
  plot.y_label = "NIS / dof";
  for (const auto& sensor : log.sensors) {
    PlotLine& line = plot.lines.emplace_back();
    line.label = sensor.name;
    double sum = 0.0;
    int count = 0;
    std::int64_t begin = 0;
    for (std::size_t i = 0; i < sensor.innovations.size(); ++i) {
      const StampedValue& v = sensor.innovations[i];
      if (count == 0) begin = v.stamp_ns;
      sum += v.value;
      ++count;
      if (v.stamp_ns - begin < 1'000'000'000 && i + 1 < sensor.innovations.size()) continue;
      line.points.emplace_back(since_start(truth, begin), sum / count);
      sum = 0.0;
      count = 0;
    }
  }
  return plot;
}

Plot position_error_over_distance(std::span<const Evaluation> evaluations) {
  Plot plot;
  plot.title = "Position error over distance";
  plot.x_label = "distance travelled [m]";
  plot.y_label = "position error [m]";
  add_lines(plot, evaluations, [](const Sample& s) { return Eigen::Vector2d(s.distance_m, s.position_error_m); });
  return plot;
}

Plot position_error_over_time(const Trajectory& truth, std::span<const Evaluation> evaluations) {
  Plot plot;
  plot.title = "Position error over time";
  plot.x_label = "time [s]";
  plot.y_label = "position error [m]";
  add_lines(plot, evaluations,
            [&](const Sample& s) { return Eigen::Vector2d(since_start(truth, s.stamp_ns), s.position_error_m); });
  return plot;
}

Plot heading_over_time(const Trajectory& truth, std::span<const Evaluation> evaluations) {
  Plot plot;
  plot.title = "Heading over time";
  plot.x_label = "time [s]";
  plot.y_label = "heading [deg]";
  plot.first_is_truth = true;
  const std::vector<double> headings = unwrapped_headings(truth);
  plot.lines.push_back({"truth", {}});
  for (std::size_t i = 0; i < truth.size(); ++i) {
    plot.lines[0].points.emplace_back(since_start(truth, truth[i].stamp_ns), kDegrees * headings[i]);
  }
  for (const Evaluation& e : evaluations) {
    PlotLine& line = plot.lines.emplace_back();
    line.label = e.name;
    std::size_t i = 0;  // the truth's pose at or before the sample: all lines count the same turns
    for (const Sample& s : e.samples) {
      while (i + 1 < truth.size() && truth[i + 1].stamp_ns <= s.stamp_ns) ++i;
      const double heading = headings[i] + wrap_angle(yaw(s.truth.linear()) - headings[i]) + s.yaw_error_rad;
      line.points.emplace_back(since_start(truth, s.stamp_ns), kDegrees * heading);
    }
  }
  return plot;
}

Plot heading_error_over_time(const Trajectory& truth, std::span<const Evaluation> evaluations) {
  Plot plot;
  plot.title = "Heading error over time";
  plot.x_label = "time [s]";
  plot.y_label = "heading error [deg]";
  add_lines(plot, evaluations, [&](const Sample& s) {
    return Eigen::Vector2d(since_start(truth, s.stamp_ns), kDegrees * s.yaw_error_rad);
  });
  return plot;
}

Plot tunnel_error_over_distance(std::span<const Evaluation> evaluations, bool axial) {
  Plot plot;
  plot.title = axial ? "Axial error (along the truth's heading)" : "Lateral error (left of the truth's heading)";
  plot.x_label = "distance travelled [m]";
  plot.y_label = axial ? "axial error [m]" : "lateral error [m]";
  plot.height_px = 260;
  add_lines(plot, evaluations, [&](const Sample& s) {
    return Eigen::Vector2d(s.distance_m, axial ? s.axial_error_m : s.lateral_error_m);
  });
  return plot;
}

std::string report_html(const Trajectory& truth, std::span<const Evaluation> evaluations,
                        const ReportOptions& options) {
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>" + escape_html(options.title) +
      "</title>\n<style>body{font-family:sans-serif;max-width:960px;margin:2em auto;padding:0 1em;color:#222}"
      "pre{overflow-x:auto;background:#f6f6f6;padding:.8em;font-size:12px}svg{display:block;margin:1.2em 0;"
      "max-width:100%;height:auto}img{max-width:100%}th{text-align:left;vertical-align:top;padding-right:1.5em;"
      "font-weight:normal;color:#666;white-space:nowrap}</style></head><body>\n<h1>" +
      escape_html(options.title) + "</h1>\n";
  if (!options.description.empty()) out += "<p>" + escape_html(options.description) + "</p>\n";
  out += inputs_table(options);
  out += "<h2>Figures</h2>\n" + preformatted(print_table(evaluations));
  out +=
      "<p>ATE after alignment; drift, heading, axial and lateral error at the end from the first common pose on; "
      "scale is the factor that fits the estimate to the truth; NEES is 3 and 3 sigma nearly 100 % when a covariance "
      "is "
      "right; CPU is that of the component alone, of the simulated time; a dash is a figure that does not exist.</p>\n";
  const std::string parts = print_decomposition_table(evaluations);
  if (!parts.empty()) {
    out += "<h2>Where the position errors come from</h2>\n" + preformatted(parts) +
           "<p>By heading: what goes away when each step is turned by the heading error of its instant. By scale: what "
           "then goes away with one factor on all steps.</p>\n";
  }
  const std::string drift = print_drift_table(evaluations);
  if (!drift.empty()) out += "<h2>Drift by length</h2>\n" + preformatted(drift);
  out += fusion_table(options);
  out += "<h2>Plots</h2>\n";
  if (!options.map.empty()) out += render_svg(map_with_route(truth, options.map));
  Plot view = top_view(truth, evaluations);
  view.background = options.map;
  out += render_svg(view);
  std::vector<Plot> timed = {heading_over_time(truth, evaluations), position_error_over_time(truth, evaluations),
                             heading_error_over_time(truth, evaluations), nees_over_time(truth, evaluations)};
  for (const FusionLog& log : options.fusion) timed.push_back(nis_over_time(truth, log));
  for (Plot& plot : timed) {
    if (plot.lines.empty()) continue;
    for (const auto& [from, to] : options.outages_ns) {
      plot.shaded.push_back({since_start(truth, from), since_start(truth, to)});
    }
    out += render_svg(plot);
  }
  out += render_svg(position_error_over_distance(evaluations));
  out += render_svg(tunnel_error_over_distance(evaluations, true));
  out += render_svg(tunnel_error_over_distance(evaluations, false));
  for (const ReportOptions::Picture& picture : options.pictures) {
    out += "<h2>" + escape_html(picture.caption) + "</h2>\n<img alt=\"\" src=\"data:image/png;base64," +
           base64(picture.png) + "\">\n";
  }
  return out + "</body></html>\n";
}

Result<void> write_report(const std::string& path, const Trajectory& truth, std::span<const Evaluation> evaluations,
                          const ReportOptions& options) {
  if (evaluations.empty()) return Error{ErrorCode::invalid_argument, path + ": no estimate to report"};
  std::ofstream file(path);
  file << report_html(truth, evaluations, options);
  file.flush();
  if (!file) return Error{ErrorCode::io, path + ": cannot write: " + std::strerror(errno)};
  return {};
}

}  // namespace adit::evaluation
