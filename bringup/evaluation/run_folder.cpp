#include "bringup/evaluation/run_folder.hpp"

#include <algorithm>
#include <filesystem>

#include "bringup/evaluation/consistency.hpp"

namespace adit::evaluation {
namespace {

// The experiment's estimates in the order of its table; others stand between the front ends and the fused ones.
constexpr const char* kOrder[] = {"lidar_kiss",       "lidar_genz", "lidar_default", "thermal_mono",
                                  "thermal_anchored", nullptr,      "fused_paper",   "fused_default"};

std::size_t rank(const std::string& name) {
  std::size_t other = 0;
  for (std::size_t i = 0; i < std::size(kOrder); ++i) {
    if (kOrder[i] == nullptr) {
      other = i;
    } else if (name == kOrder[i]) {
      return i;
    }
  }
  return other;
}

}  // namespace

Result<Evaluation> evaluate_file(const std::string& name, const std::string& path, const Trajectory& truth,
                                 const Options& options) {
  const Result<Trajectory> estimate = read_tum(path);
  if (!estimate) return estimate.error();
  Result<Evaluation> evaluation =
      estimate->empty() ? nothing_delivered(name, truth) : evaluate(truth, *estimate, options);
  if (!evaluation) return Error{evaluation.error().code, name + ": " + evaluation.error().message};
  evaluation->name = name;
  const std::filesystem::path beside = std::filesystem::path(path).replace_extension(".cov");
  if (std::filesystem::exists(beside)) {
    const Result<std::vector<StampedCovariance>> covariances = read_covariances(beside.string());
    if (!covariances) return covariances.error();
    add_consistency(*covariances, *evaluation);
  }
  return evaluation;
}

Result<RunFolder> evaluate_folder(const std::string& folder, const Options& options) {
  namespace fs = std::filesystem;
  RunFolder run;
  Result<Trajectory> truth = read_tum((fs::path(folder) / "truth.tum").string());
  if (!truth) return truth.error();
  run.truth = *std::move(truth);
  std::vector<std::string> names;
  std::error_code bad;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, bad)) {
    if (entry.path().extension() == ".tum" && entry.path().stem() != "truth") names.push_back(entry.path().stem());
  }
  if (bad) return Error{ErrorCode::io, folder + ": " + bad.message()};
  if (names.empty()) return Error{ErrorCode::not_found, folder + ": no trajectories beside truth.tum"};
  std::sort(names.begin(), names.end(),
            [](const std::string& a, const std::string& b) { return std::pair(rank(a), a) < std::pair(rank(b), b); });
  for (const std::string& name : names) {
    const fs::path file = fs::path(folder) / name;
    Result<Evaluation> evaluation = evaluate_file(name, file.string() + ".tum", run.truth, options);
    if (!evaluation) return evaluation.error();
    run.evaluations.push_back(*std::move(evaluation));
    if (!fs::exists(file.string() + ".csv")) continue;
    Result<FusionLog> log = read_fusion_log(file.string() + ".csv");
    if (!log) return log.error();
    log->name = name;
    run.fusion.push_back(*std::move(log));
  }
  return run;
}

}  // namespace adit::evaluation
