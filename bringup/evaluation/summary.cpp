#include "bringup/evaluation/summary.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <set>
#include <vector>

#include <nlohmann/json.hpp>

#include "bringup/evaluation/decomposition.hpp"
#include "bringup/evaluation/text_table.hpp"

namespace adit::evaluation {
namespace {

using Json = nlohmann::ordered_json;
using Row = TextRow;

Json number(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

std::string text(const std::optional<double>& value, const char* format) {
  if (!value) return "-";
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, format, *value);
  return buffer;
}

std::optional<double> percent(const std::optional<double>& part, double whole) {
  return part && whole > 0.0 ? std::optional<double>(100.0 * *part / whole) : std::nullopt;
}

}  // namespace

std::string summary_json(std::span<const Evaluation> evaluations) {
  Json summary;
  summary["estimates"] = Json::object();
  for (const Evaluation& e : evaluations) {
    Json& row = summary["estimates"][e.name];
    row["ate_m"] = number(e.ate_rmse_m);
    row["rpe_10m_percent"] = number(e.rpe_10m_percent);
    row["drift_percent"] = number(e.drift_percent);
    row["yaw_end_deg"] = number(e.yaw_end_deg);
    row["scale"] = number(e.scale);
    row["availability"] = e.availability;
    row["frames"] = e.frames;
    row["axial_end_m"] = number(e.axial_end_m);
    row["lateral_end_m"] = number(e.lateral_end_m);
    row["largest_gap_s"] = e.largest_gap_s;
    row["nees"] = number(e.nees_mean);
    row["sigma3_coverage"] = number(e.sigma3_coverage);
    row["cpu_s"] = number(e.cpu_s);
    const Decomposition parts = decompose(e.samples);
    row["error_end_m"] = {{"total", parts.end.total_m},
                          {"yaw", parts.end.yaw_m},
                          {"scale", parts.end.scale_m},
                          {"rest", parts.end.rest_m},
                          {"yaw_share", parts.yaw_share}};
  }
  summary["distance_m"] = evaluations.empty() ? Json(nullptr) : Json(evaluations.front().truth_distance_m);
  summary["duration_s"] = evaluations.empty() ? Json(nullptr) : Json(evaluations.front().truth_duration_s);
  // A name may hold any bytes: what is not UTF-8 is replaced, never thrown.
  return summary.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

Result<void> write_summary(const std::string& path, std::span<const Evaluation> evaluations) {
  if (evaluations.empty()) return Error{ErrorCode::invalid_argument, path + ": no estimate to summarize"};
  std::set<std::string> names;
  for (const Evaluation& e : evaluations) {
    if (!names.insert(e.name).second) {
      return Error{ErrorCode::invalid_argument, "two estimates are named '" + e.name + "'"};
    }
  }
  std::ofstream file(path);
  file << summary_json(evaluations);
  file.flush();
  if (!file) return Error{ErrorCode::io, path + ": cannot write: " + std::strerror(errno)};
  return {};
}

std::string print_table(std::span<const Evaluation> evaluations) {
  std::vector<Row> rows = {{"estimate", "ATE rmse [m]", "median", "max", "RPE 10 m [%]", "drift [%]", "yaw end [deg]",
                            "axial end [m]", "lateral end [m]", "scale", "available [%]", "gap max [s]", "NEES",
                            "3 sigma [%]", "CPU [%]", "frames"}};
  for (const Evaluation& e : evaluations) {
    rows.push_back({e.name, text(e.ate_rmse_m, "%.3f"), text(e.ate_median_m, "%.3f"), text(e.ate_max_m, "%.3f"),
                    text(e.rpe_10m_percent, "%.3f"), text(e.drift_percent, "%.3f"), text(e.yaw_end_deg, "%.3f"),
                    text(e.axial_end_m, "%+.3f"), text(e.lateral_end_m, "%+.3f"), text(e.scale, "%.5f"),
                    text(100.0 * e.availability, "%.1f"), text(e.largest_gap_s, "%.2f"), text(e.nees_mean, "%.2f"),
                    text(percent(e.sigma3_coverage, 1.0), "%.1f"), text(percent(e.cpu_s, e.truth_duration_s), "%.1f"),
                    std::to_string(e.frames)});
  }
  return lay_out(rows);
}

std::string print_decomposition_table(std::span<const Evaluation> evaluations) {
  std::vector<Row> rows = {{"estimate", "error at the end [m]", "by heading", "by scale", "rest", "rms [m]",
                            "by heading", "by scale", "rest", "share of the heading [%]", "speed scale"}};
  for (const Evaluation& e : evaluations) {
    if (e.samples.size() < 2) continue;
    const Decomposition d = decompose(e.samples);
    Row& row = rows.emplace_back(Row{e.name});
    for (const ErrorParts& parts : {d.end, d.rms}) {
      for (const double value : {parts.total_m, parts.yaw_m, parts.scale_m, parts.rest_m}) {
        row.push_back(text(value, "%.3f"));
      }
    }
    row.push_back(text(100.0 * d.yaw_share, "%.0f"));
    row.push_back(text(d.speed_scale, "%.5f"));
  }
  return rows.size() == 1 ? std::string() : lay_out(rows);
}

std::string print_drift_table(std::span<const Evaluation> evaluations) {
  std::vector<Row> rows = {{"estimate", "length [m]", "segments", "drift [%]", "rotation [deg/m]", "RPE rmse [m]"}};
  for (const Evaluation& e : evaluations) {
    for (const DriftByLength& d : e.drift) {
      rows.push_back({e.name, text(d.length_m, "%g"), std::to_string(d.segments), text(d.translation_percent, "%.3f"),
                      text(d.rotation_deg_per_m, "%.4f"), text(d.translation_rmse_m, "%.4f")});
    }
  }
  return rows.size() == 1 ? std::string() : lay_out(rows);
}

}  // namespace adit::evaluation
