#include "bringup/commands/evaluation_report.hpp"

#include <cstdio>
#include <filesystem>
#include <fstream>

#include <nlohmann/json.hpp>

#include "bringup/evaluation/summary.hpp"

namespace adit {
namespace {

namespace ev = evaluation;

Result<nlohmann::json> read_run(const std::string& path) {
  std::ifstream file(path);
  nlohmann::json run = nlohmann::json::parse(file, nullptr, false);
  if (!run.is_object() || !run.contains("wall_s") || !run["wall_s"].is_number()) {
    return Error{ErrorCode::malformed, path + ": not a file that `adit run --summary` wrote"};
  }
  return run;
}

Result<void> merge_run(const std::string& summary_path, const nlohmann::json& run, double duration_s) {
  std::ifstream summary_file(summary_path);
  nlohmann::ordered_json summary = nlohmann::ordered_json::parse(summary_file, nullptr, false);
  for (const char* key : {"middleware", "links", "cpu_s", "processes", "wall_s"}) {
    if (run.contains(key)) summary[key] = run[key];
  }
  const double wall_s = run["wall_s"];
  summary["realtime_factor"] = wall_s > 0.0 ? duration_s / wall_s : 0.0;
  std::ofstream out(summary_path);
  out << summary.dump(2) << '\n';
  out.flush();
  if (!out) return Error{ErrorCode::io, summary_path + ": cannot write"};
  return {};
}

}  // namespace

Result<void> add_run_figures(const std::string& run_path, std::vector<ev::Evaluation>& evaluations) {
  const Result<nlohmann::json> run = read_run(run_path);
  if (!run) return run.error();
  if (!run->contains("cpu_s")) return {};
  for (ev::Evaluation& e : evaluations) {
    const auto found = (*run)["cpu_s"].find("/" + e.name);
    if (found != (*run)["cpu_s"].end() && found->is_number()) e.cpu_s = found->get<double>();
  }
  return {};
}

Result<void> report_evaluations(const ev::RunFolder& run, const ev::ReportOptions& options, const std::string& run_path,
                                const std::string& out) {
  std::fputs(ev::print_table(run.evaluations).c_str(), stdout);
  std::fputs(ev::print_decomposition_table(run.evaluations).c_str(), stdout);
  std::fputs(ev::print_drift_table(run.evaluations).c_str(), stdout);
  const double duration_s = run.evaluations.front().truth_duration_s;
  Result<nlohmann::json> figures = nlohmann::json();
  if (!run_path.empty()) {
    figures = read_run(run_path);
    if (!figures) return figures.error();
    const double wall_s = (*figures)["wall_s"];
    std::printf("%.1f s of %s in %.1f s: %.2f times real time\n", duration_s,
                figures->contains("offline") ? "data" : "driving", wall_s, wall_s > 0.0 ? duration_s / wall_s : 0.0);
  }
  if (out.empty()) return {};
  std::error_code bad;
  std::filesystem::create_directories(out, bad);
  if (bad) return Error{ErrorCode::io, out + ": cannot create the folder: " + bad.message()};
  if (Result<void> written = ev::write_summary(out + "/summary.json", run.evaluations); !written) return written;
  if (Result<void> written = ev::write_report(out + "/report.html", run.truth, run.evaluations, options); !written) {
    return written;
  }
  if (!run_path.empty()) {
    if (Result<void> merged = merge_run(out + "/summary.json", *figures, duration_s); !merged) return merged;
  }
  std::printf("wrote %s/summary.json and report.html\n", out.c_str());
  return {};
}

}  // namespace adit
