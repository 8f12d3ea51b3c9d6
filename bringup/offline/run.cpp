#include "bringup/offline/run.hpp"

#include <chrono>
#include <filesystem>
#include <fstream>

#include <nlohmann/json.hpp>

#include "bringup/offline/progress.hpp"
#include "bringup/offline/recorder.hpp"
#include "bringup/offline/scenario_description.hpp"

namespace adit::offline {
namespace {

// What makes messages in a live deployment, and what answers to it: the input takes their place.
bool is_source(const ComponentConfig& component) {
  return component.type == "tunnel_simulator" || component.type == "dataset_player" || component.type == "barrier";
}

bool is_scenario(const std::string& input) {
  return std::filesystem::path(input).extension() == ".yaml";
}

// Passes messages on, watches the time go by, and lets the recorder see them.
class Watched final : public OfflineSource {
 public:
  Watched(Source& source, std::string label, Recorder& recorder)
      : source_(source), progress_(std::move(label), source.begin(), source.end()), recorder_(recorder) {}
  Result<bool> next(OfflineMessage& out) override {
    Result<bool> more = source_.next(out);
    if (more && *more) {
      progress_.at(out.stamp);
      recorder_.note(out);
    } else {
      progress_.done();
    }
    return more;
  }

 private:
  Source& source_;
  Progress progress_;
  Recorder& recorder_;
};

Result<void> write_run(const RunOutcome& outcome) {
  nlohmann::json run;
  for (const ComponentStatus& component : outcome.components) run["cpu_s"][component.name] = component.cpu_seconds;
  run["wall_s"] = outcome.wall_s;
  run["offline"] = true;
  run["messages"] = {{"delivered", outcome.messages.delivered},
                     {"unheard", outcome.messages.unheard},
                     {"out_of_order", outcome.messages.out_of_order}};
  std::ofstream file(outcome.run_path);
  file << run.dump(2) << '\n';
  file.flush();
  if (!file) return Error{ErrorCode::io, outcome.run_path + ": cannot write"};
  return {};
}

}  // namespace

Result<RunOutcome> run(const RunRequest& request) {
  std::error_code bad;
  std::filesystem::create_directories(request.out, bad);
  if (bad) return Error{ErrorCode::io, request.out + ": cannot create the folder: " + bad.message()};
  DeploymentOverrides overrides = request.overrides;
  overrides.variables.emplace("OUT", request.out);
  overrides.variables.emplace("SCENARIO", request.input);
  if (is_scenario(request.input)) {
    overrides.variables.emplace("VEHICLE", vehicle_of(request.input));
  }
  const Result<Deployment> deployment = load_deployment(request.deployment, overrides);
  if (!deployment) return deployment.error();
  std::vector<ComponentConfig> components;
  for (const DeployedProcess& deployed : deployment->processes) {
    for (const ComponentConfig& component : deployed.process.components) {
      if (!is_source(component)) components.push_back(component);
    }
  }
  Result<std::unique_ptr<OfflineRunner>> runner = OfflineRunner::build(components);
  if (!runner) return runner.error();
  SourceOptions options = request.source;
  for (const PortInfo& port : (*runner)->ports()) {
    if (port.direction == PortInfo::Direction::input) options.topics.insert(port.topic);
  }
  options.topics.insert(request.record.begin(), request.record.end());
  const Result<std::unique_ptr<Source>> source = open_source(request.input, options);
  if (!source) return source.error();

  Recorder recorder;
  if (!request.record.empty()) {
    if (Result<void> opened = recorder.open(request.out + "/bag", **runner, request.record); !opened) {
      return opened.error();
    }
  }

  RunOutcome outcome;
  const auto start = std::chrono::steady_clock::now();
  Watched watched(**source, std::filesystem::path(request.input).stem().string(), recorder);
  const Result<OfflineStats> stats = (*runner)->run(watched);
  if (!stats) return stats.error();
  if (Result<void> closed = recorder.close(); !closed) return closed.error();
  outcome.messages = *stats;
  outcome.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  outcome.simulated_s = std::chrono::duration<double>(stats->last - stats->first).count();
  outcome.components = (*runner)->status();
  outcome.run_path = request.out + "/run.json";
  if (Result<void> written = write_run(outcome); !written) return written.error();
  return outcome;
}

Result<evaluation::RunFolder> evaluate_run(const std::string& folder, const std::string& input,
                                           evaluation::ReportOptions& report) {
  evaluation::Options options;
  if (is_scenario(input)) {
    if (Result<void> described = describe_scenario(input, options, report); !described) return described.error();
  }
  Result<evaluation::RunFolder> run = evaluation::evaluate_folder(folder, options);
  if (run) report.fusion = run->fusion;
  return run;
}

}  // namespace adit::offline
