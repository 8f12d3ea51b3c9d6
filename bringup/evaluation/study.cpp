#include "bringup/evaluation/study.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <nlohmann/json.hpp>

#include "bringup/evaluation/text_table.hpp"

namespace adit::evaluation {
namespace {

using Figure = std::optional<double> StudyRow::*;

struct Column {
  const char* title;
  Figure figure;
  const char* format;
  bool worst;  // show the largest absolute value too
};

constexpr Column kColumns[] = {
    {"drift [%]", &StudyRow::drift_percent, "%.3f", true},
    {"axial [%]", &StudyRow::axial_percent, "%.3f", true},
    {"lateral [m]", &StudyRow::lateral_end_m, "%.2f", true},
    {"yaw [deg]", &StudyRow::yaw_end_deg, "%.3f", true},
    {"ATE [m]", &StudyRow::ate_m, "%.3f", true},
    {"scale", &StudyRow::scale, "%.4f", false},
    {"NEES", &StudyRow::nees, "%.1f", false},
    {"3 sigma", &StudyRow::sigma3_coverage, "%.2f", false},
};

std::string text(const char* format, double value) {
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, format, value);
  return buffer;
}

// Of each outage the median over the runs and the worst: "0.12 (0.20) 1.30 (1.90)" for two of them.
std::string outage_cell(const std::vector<const StudyRow*>& group) {
  std::string out;
  for (const OutageGrowth& outage : group.front()->outages) {
    std::vector<double> errors;
    for (const StudyRow* row : group) {
      for (const OutageGrowth& o : row->outages) {
        if (o.from_ns == outage.from_ns && o.to_ns == outage.to_ns) errors.push_back(o.error_m);
      }
    }
    if (!out.empty()) out += " ";
    out += text("%.2f", *median(errors));
    if (errors.size() > 1) out += text(" (%.2f)", *std::max_element(errors.begin(), errors.end()));
  }
  return out.empty() ? "-" : out;
}

std::string cell(const std::vector<const StudyRow*>& group, const Column& column) {
  std::vector<double> values;
  for (const StudyRow* row : group) {
    if (const std::optional<double>& value = row->*column.figure) {
      values.push_back(column.worst ? std::abs(*value) : *value);
    }
  }
  const std::optional<double> middle = median(values);
  if (!middle) return "-";
  std::string out = text(column.format, *middle);
  if (column.worst && values.size() > 1) {
    out += " (" + text(column.format, *std::max_element(values.begin(), values.end())) + ")";
  }
  return out;
}

}  // namespace

std::optional<double> median(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

StudyRow study_row(const std::string& scenario, std::uint64_t seed, const Evaluation& e,
                   std::span<const std::pair<std::int64_t, std::int64_t>> outages_ns) {
  StudyRow row;
  row.scenario = scenario;
  row.estimate = e.name;
  row.seed = seed;
  row.distance_m = e.truth_distance_m;
  row.drift_percent = e.drift_percent;
  if (e.axial_end_m && e.distance_m > 0.1) row.axial_percent = 100.0 * *e.axial_end_m / e.distance_m;
  row.lateral_end_m = e.lateral_end_m;
  row.yaw_end_deg = e.yaw_end_deg;
  row.ate_m = e.ate_rmse_m;
  row.scale = e.scale;
  row.nees = e.nees_mean;
  row.sigma3_coverage = e.sigma3_coverage;
  row.outages = outage_growth(e, outages_ns);
  row.availability = e.availability;
  row.largest_gap_s = e.largest_gap_s;
  return row;
}

std::string print_study(const std::vector<StudyRow>& rows) {
  std::vector<std::vector<const StudyRow*>> groups;
  for (const StudyRow& row : rows) {
    const auto same = std::find_if(groups.begin(), groups.end(), [&](const auto& group) {
      return group.front()->scenario == row.scenario && group.front()->estimate == row.estimate;
    });
    if (same != groups.end()) {
      same->push_back(&row);
    } else {
      groups.push_back({&row});
    }
  }
  std::vector<TextRow> table = {{"scenario", "estimate", "runs", "way [m]"}};
  for (const Column& column : kColumns) table[0].emplace_back(column.title);
  table[0].insert(table[0].end(), {"outages [m]", "available [%]", "gap [s]"});
  std::string last;
  for (const auto& group : groups) {
    const StudyRow& first = *group.front();
    TextRow& line = table.emplace_back();
    line = {first.scenario == last ? "" : first.scenario, first.estimate, std::to_string(group.size()),
            text("%.0f", first.distance_m)};
    last = first.scenario;
    for (const Column& column : kColumns) line.push_back(cell(group, column));
    double available = 1.0, gap = 0.0;
    for (const StudyRow* row : group) {
      available = std::min(available, row->availability);
      gap = std::max(gap, row->largest_gap_s);
    }
    line.push_back(outage_cell(group));
    line.push_back(text("%.1f", 100.0 * available));
    line.push_back(text("%.2f", gap));
  }
  return lay_out(table);
}

std::string study_json(const std::vector<StudyRow>& rows) {
  using Json = nlohmann::ordered_json;
  const auto number = [](const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); };
  Json runs = Json::array();
  for (const StudyRow& r : rows) {
    Json outages = Json::array();
    for (const OutageGrowth& o : r.outages) {
      outages.push_back(
          {{"from_ns", o.from_ns}, {"to_ns", o.to_ns}, {"error_m", o.error_m}, {"distance_m", o.distance_m}});
    }
    runs.push_back({{"scenario", r.scenario},
                    {"seed", r.seed},
                    {"estimate", r.estimate},
                    {"distance_m", r.distance_m},
                    {"drift_percent", number(r.drift_percent)},
                    {"axial_percent", number(r.axial_percent)},
                    {"lateral_end_m", number(r.lateral_end_m)},
                    {"yaw_end_deg", number(r.yaw_end_deg)},
                    {"ate_m", number(r.ate_m)},
                    {"scale", number(r.scale)},
                    {"nees", number(r.nees)},
                    {"sigma3_coverage", number(r.sigma3_coverage)},
                    {"outages", outages},
                    {"availability", r.availability},
                    {"largest_gap_s", r.largest_gap_s}});
  }
  return Json({{"runs", runs}}).dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace adit::evaluation
