#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>

#include <nlohmann/json.hpp>

#include "bringup/commands/command.hpp"
#include "bringup/commands/deployment_options.hpp"
#include "bringup/commands/process_status.hpp"
#include "bringup/deployment/deployment.hpp"
#include "bringup/supervisor/service_manager.hpp"
#include "bringup/supervisor/status_table.hpp"
#include "bringup/supervisor/supervisor.hpp"
#include "middleware/participant.hpp"

namespace adit {
namespace {

struct Arguments {
  DeploymentArguments deployment;
  double duration_s = 0.0;
  std::string summary;  // file for the run's figures
  bool quiet = false;
  bool check_only = false;
};

// A folder for the status files of the run's processes, removed at the end.
class StatusFolder {
 public:
  StatusFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "adit_run_XXXXXX").string();
    if (::mkdtemp(name.data())) path_ = name;
  }
  ~StatusFolder() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
  }
  StatusFolder(const StatusFolder&) = delete;
  StatusFolder& operator=(const StatusFolder&) = delete;
  std::string file(const std::string& process) const { return path_ + "/" + process + ".json"; }

 private:
  std::string path_;
};

ChildSpec child_spec(const DeployedProcess& deployed, const ExpectedMatches& expected, const Arguments& arguments,
                     const StatusFolder& folder) {
  ChildSpec spec;
  spec.name = deployed.process.name;
  spec.command = {std::filesystem::read_symlink("/proc/self/exe").string(),
                  "host",
                  "--process",
                  spec.name,
                  "--status-file",
                  folder.file(spec.name)};
  for (const std::string& word : arguments.deployment.command_line()) spec.command.push_back(word);
  for (const auto& [option, by_topic] :
       {std::pair("--expect-writers", &expected.writers), std::pair("--expect-readers", &expected.readers)}) {
    for (const auto& [topic, count] : *by_topic) {
      spec.command.push_back(option);
      spec.command.push_back(topic + "=" + std::to_string(count));
    }
  }
  spec.environment = deployed.environment;
  spec.restart = deployed.restart;
  spec.starts_when_linked = deployed.starts_when_linked;
  spec.stops_all = deployed.stops_all;
  spec.stop_timeout = deployed.stop_timeout;
  return spec;
}

// A restarted process brings its components back to the states they were last seen in.
void restore_states(const ChildStatus& status, ChildSpec& spec) {
  const auto first = std::find(spec.command.begin(), spec.command.end(), "--state");
  spec.command.erase(first, spec.command.end());
  for (const ComponentStatus& component : status.report.components) {
    if (component.state != LifecycleState::inactive && component.state != LifecycleState::unconfigured) continue;
    spec.command.push_back("--state");
    spec.command.push_back(component.name + "=" + std::string(to_string(component.state)));
  }
}

Result<void> write_run_summary(const std::string& path, const Deployment& deployment, const StatusFolder& folder,
                               const std::vector<ChildStatus>& children, double wall_s) {
  nlohmann::json summary;
  std::map<std::string, LinkTotals> links;
  for (const DeployedProcess& deployed : deployment.processes) {
    summary["middleware"][deployed.process.name] = deployed.process.middleware.vendor.empty()
                                                       ? std::string(built_in_vendors().front())
                                                       : deployed.process.middleware.vendor;
    const Result<ProcessStatus> status = read_process_status(folder.file(deployed.process.name));
    if (!status) continue;  // killed before it could write: its links are missing, its CPU is below
    for (const auto& [topic, totals] : status->links) links[topic] += totals;
    for (const auto& [component, cpu_s] : status->cpu_s) summary["cpu_s"][component] = cpu_s;
  }
  for (const ChildStatus& child : children) {
    summary["processes"][child.name] = {{"cpu_s", child.cpu_s}, {"restarts", child.restarts}, {"end", child.last_end}};
  }
  for (const auto& [topic, totals] : links) {
    summary["links"][topic] = {
        {"sent", totals.sent}, {"received", totals.received}, {"lost", totals.lost}, {"dropped", totals.dropped}};
  }
  summary["wall_s"] = wall_s;
  std::ofstream file(path);
  file << summary.dump(2) << '\n';
  file.flush();
  if (!file) return Error{ErrorCode::io, path + ": cannot write the summary"};
  return {};
}

// A process that was given up leaves the watchdog hungry: the service manager then starts the whole deployment afresh.
void report(ServiceManager& service, const std::vector<ChildStatus>& children) {
  std::size_t running = 0;
  int restarts = 0;
  std::string failed;
  for (const ChildStatus& child : children) {
    running += child.state == ChildStatus::State::running;
    restarts += child.restarts;
    if (child.state == ChildStatus::State::failed) failed += " " + child.name + " (" + child.last_end + ")";
  }
  service.ready();
  if (failed.empty()) {
    service.alive(std::to_string(running) + " of " + std::to_string(children.size()) + " processes run, " +
                  std::to_string(restarts) + " restarts");
  } else {
    service.failing("given up:" + failed);
  }
}

Result<void> run(const Arguments& arguments) {
  const Result<Deployment> deployment = load_deployment(arguments.deployment.path, arguments.deployment.overrides());
  if (!deployment) return deployment.error();
  const Result<std::vector<std::string>> mismatches = check_links(*deployment);
  if (!mismatches) return mismatches.error();
  if (!mismatches->empty()) {
    std::string text = deployment->path + ": links that cannot work:";
    for (const std::string& line : *mismatches) text += "\n  " + line;
    return Error{ErrorCode::incompatible, text};
  }
  if (arguments.check_only) {
    std::printf("%s: %zu processes, fine\n", deployment->path.c_str(), deployment->processes.size());
    return {};
  }
  const StatusFolder folder;
  std::vector<ChildSpec> children;
  for (const DeployedProcess& deployed : deployment->processes) {
    const Result<ExpectedMatches> expected = expected_matches(*deployment, deployed.process.name);
    if (!expected) return expected.error();
    children.push_back(child_spec(deployed, *expected, arguments, folder));
  }

  Supervisor supervisor(std::move(children));
  supervisor.on_restart(restore_states);
  StatusTable table(::isatty(STDOUT_FILENO) != 0 && !arguments.quiet);
  supervisor.on_log([&](const std::string& line) { table.log(line); });
  ServiceManager service;
  supervisor.observe(std::chrono::seconds(1), [&](const std::vector<ChildStatus>& status) {
    table.show(status);
    report(service, status);
  });
  const auto start = std::chrono::steady_clock::now();
  std::optional<Duration> limit;
  if (arguments.duration_s > 0.0) limit = Duration(static_cast<std::int64_t>(arguments.duration_s * 1e9));
  const bool well = supervisor.run(limit);
  service.stopping();
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (!arguments.summary.empty()) {
    if (Result<void> written = write_run_summary(arguments.summary, *deployment, folder, supervisor.status(), wall_s);
        !written) {
      return written;
    }
  }
  if (!well) return Error{ErrorCode::unavailable, "a process failed; see above"};
  return {};
}

}  // namespace

void add_run_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("run", "start the processes of a deployment file and keep them running");
  arguments->deployment.add_to(*command);
  command->add_option("--duration", arguments->duration_s, "stop after this time [s] (default: when done, or Ctrl-C)");
  command->add_option("--summary", arguments->summary,
                      "write links, CPU and wall time to this JSON file (for adit evaluate --run)");
  command->add_flag("--quiet", arguments->quiet, "log lines instead of the live table");
  command->add_flag("--check", arguments->check_only, "check the file and the links between components, start nothing");
  command->callback([arguments, &code] {
    if (Result<void> done = run(*arguments); !done) code = fail(done.error());
  });
}

}  // namespace adit
