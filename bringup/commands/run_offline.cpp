#include <cstdio>
#include <filesystem>

#include "bringup/commands/deployment_options.hpp"
#include "bringup/commands/evaluation_report.hpp"
#include "bringup/commands/file_commands.hpp"
#include "bringup/offline/run.hpp"

namespace adit {
namespace {

struct Arguments {
  DeploymentArguments deployment;
  offline::RunRequest request;
  std::int64_t seed = -1;
};

Result<void> run(Arguments& arguments) {
  offline::RunRequest& request = arguments.request;
  request.deployment = arguments.deployment.path;
  request.overrides = arguments.deployment.overrides();
  if (arguments.seed >= 0) request.source.seed = static_cast<std::uint64_t>(arguments.seed);
  const Result<offline::RunOutcome> outcome = offline::run(request);
  if (!outcome) return outcome.error();
  std::printf("%zu components, %llu messages, %.1f s of data in %.1f s\n", outcome->components.size(),
              static_cast<unsigned long long>(outcome->messages.delivered), outcome->simulated_s, outcome->wall_s);
  for (const ComponentStatus& component : outcome->components) {
    std::printf("  %-24s %7.2f s CPU  %s\n", component.name.c_str(), component.cpu_seconds, component.reason.c_str());
  }
  if (!std::filesystem::exists(request.out + "/truth.tum")) return {};  // nothing to compare with
  evaluation::ReportOptions report;
  Result<evaluation::RunFolder> evaluated = offline::evaluate_run(request.out, request.input, report);
  if (!evaluated) return evaluated.error();
  if (Result<void> added = add_run_figures(outcome->run_path, evaluated->evaluations); !added) return added;
  return report_evaluations(*evaluated, report, outcome->run_path, request.out);
}

}  // namespace

void add_run_offline_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  offline::RunRequest& request = arguments->request;
  CLI::App* command = app.add_subcommand(file_commands::run_offline.name, file_commands::run_offline.description);
  arguments->deployment.add_to(*command);
  command->add_option("--input", request.input, "scenario file, bag or folder of clouds: instead of the file's sources")
      ->required()
      ->check(CLI::ExistingPath);
  command->add_option("--out", request.out, "folder for what the components write (${OUT}), run.json and the report")
      ->required();
  command->add_option("--duration", request.source.duration_s, "stop after this time of the input [s]");
  command->add_option("--seed", arguments->seed, "of the simulation, instead of the scenario's");
  command->add_option("--record", request.record,
                      "topic of the components or of the simulation to write to the bag OUT/bag (repeatable)");
  command->add_option("--threads", request.source.threads, "of the simulation; the data do not depend on it")
      ->capture_default_str();
  command->callback([arguments, &code] {
    if (Result<void> done = run(*arguments); !done) code = fail(done.error());
  });
}

}  // namespace adit
