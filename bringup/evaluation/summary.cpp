#include "bringup/evaluation/summary.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <set>
#include <vector>

#include <nlohmann/json.hpp>

namespace adit::evaluation {
namespace {

using Json = nlohmann::ordered_json;
using Row = std::vector<std::string>;

Json number(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

std::string text(const std::optional<double>& value, const char* format) {
  if (!value) return "-";
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, format, *value);
  return buffer;
}

// First column left, the others right aligned.
std::string layout(const std::vector<Row>& rows) {
  std::vector<std::size_t> width(rows.front().size(), 0);
  for (const Row& row : rows) {
    for (std::size_t c = 0; c < row.size(); ++c) width[c] = std::max(width[c], row[c].size());
  }
  std::string out;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t c = 0; c < width.size(); ++c) {
      const std::string pad(width[c] - rows[r][c].size(), ' ');
      out += c == 0 ? rows[r][c] + pad : "  " + pad + rows[r][c];
    }
    while (out.back() == ' ') out.pop_back();
    out += '\n';
    if (r > 0) continue;
    for (std::size_t c = 0; c < width.size(); ++c) out += (c == 0 ? "" : "  ") + std::string(width[c], '-');
    out += '\n';
  }
  return out;
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
                            "axial end [m]", "lateral end [m]", "scale", "available [%]", "gap max [s]", "frames"}};
  for (const Evaluation& e : evaluations) {
    rows.push_back({e.name, text(e.ate_rmse_m, "%.3f"), text(e.ate_median_m, "%.3f"), text(e.ate_max_m, "%.3f"),
                    text(e.rpe_10m_percent, "%.3f"), text(e.drift_percent, "%.3f"), text(e.yaw_end_deg, "%.3f"),
                    text(e.axial_end_m, "%+.3f"), text(e.lateral_end_m, "%+.3f"), text(e.scale, "%.5f"),
                    text(100.0 * e.availability, "%.1f"), text(e.largest_gap_s, "%.2f"), std::to_string(e.frames)});
  }
  return layout(rows);
}

std::string print_drift_table(std::span<const Evaluation> evaluations) {
  std::vector<Row> rows = {{"estimate", "length [m]", "segments", "drift [%]", "rotation [deg/m]", "RPE rmse [m]"}};
  for (const Evaluation& e : evaluations) {
    for (const DriftByLength& d : e.drift) {
      rows.push_back({e.name, text(d.length_m, "%g"), std::to_string(d.segments), text(d.translation_percent, "%.3f"),
                      text(d.rotation_deg_per_m, "%.4f"), text(d.translation_rmse_m, "%.4f")});
    }
  }
  return rows.size() == 1 ? std::string() : layout(rows);
}

}  // namespace adit::evaluation
