#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "bringup/commands/deployment_options.hpp"
#include "bringup/commands/file_commands.hpp"
#include "bringup/evaluation/study.hpp"
#include "bringup/offline/run.hpp"
#include "bringup/offline/scenario_description.hpp"

namespace adit {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string deployment = "bringup/deployments/experiment.yaml";
  std::string folder = "bringup/scenarios";
  std::string scenarios = "all";  // beginnings of file names, separated by commas
  std::vector<std::string> variables;
  fs::path out;
  std::vector<std::string> record;
  fs::path recorded;
  int first_seed = 1, seeds = 5;
  double duration_s = 0.0;
  int threads = 2;
};

Result<std::vector<std::string>> find_scenarios(const Arguments& arguments) {
  std::vector<std::string> wanted, found;
  std::stringstream list(arguments.scenarios);
  for (std::string word; std::getline(list, word, ',');) wanted.push_back(word);
  std::error_code bad;
  for (const fs::directory_entry& entry : fs::directory_iterator(arguments.folder, bad)) {
    const std::string name = entry.path().stem();
    const bool chosen = std::any_of(wanted.begin(), wanted.end(),
                                    [&](const std::string& w) { return w == "all" || name.starts_with(w); });
    if (entry.path().extension() == ".yaml" && chosen) found.push_back(entry.path().string());
  }
  if (bad) return Error{ErrorCode::io, arguments.folder + ": " + bad.message()};
  if (found.empty()) {
    return Error{ErrorCode::not_found, arguments.folder + ": no scenario begins with '" + arguments.scenarios + "'"};
  }
  std::sort(found.begin(), found.end());
  return found;
}

Result<void> write(const fs::path& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  file.flush();
  if (!file) return Error{ErrorCode::io, path.string() + ": cannot write"};
  return {};
}

// One scenario with one seed. What fails is told and left out: the others still count.
Result<void> run_one(const Arguments& arguments, const std::string& scenario, std::uint64_t seed,
                     std::vector<evaluation::StudyRow>& rows) {
  const std::string name = fs::path(scenario).stem();
  offline::RunRequest request;
  request.deployment = arguments.deployment;
  for (const std::string& variable : arguments.variables) {
    const std::size_t equals = variable.find('=');
    if (equals == std::string::npos)
      return Error{ErrorCode::invalid_argument, "--set '" + variable + "': give NAME=VALUE"};
    request.overrides.variables[variable.substr(0, equals)] = variable.substr(equals + 1);
  }
  const fs::path place = fs::path(name) / std::to_string(seed);
  request.input = arguments.recorded.empty() ? scenario : (arguments.recorded / place / "bag").string();
  request.overrides.variables.emplace("VEHICLE", offline::vehicle_of(scenario));
  request.out = (arguments.out / place).string();
  request.record = arguments.record;
  request.source.duration_s = arguments.duration_s;
  request.source.seed = seed;
  request.source.threads = arguments.threads;
  const Result<offline::RunOutcome> outcome = offline::run(request);
  if (!outcome) return outcome.error();
  evaluation::ReportOptions report;
  const Result<evaluation::RunFolder> evaluated = offline::evaluate_run(request.out, scenario, report);
  if (!evaluated) return evaluated.error();
  if (Result<void> written =
          evaluation::write_report(request.out + "/report.html", evaluated->truth, evaluated->evaluations, report);
      !written) {
    return written;
  }
  for (const evaluation::Evaluation& e : evaluated->evaluations)
    rows.push_back(evaluation::study_row(name, seed, e, report.outages_ns));
  std::printf("%s seed %llu: %.0f s of data in %.0f s\n", name.c_str(), static_cast<unsigned long long>(seed),
              outcome->simulated_s, outcome->wall_s);
  std::fflush(stdout);
  return {};
}

Result<void> run(const Arguments& arguments) {
  const Result<std::vector<std::string>> scenarios = find_scenarios(arguments);
  if (!scenarios) return scenarios.error();
  std::error_code bad;
  fs::create_directories(arguments.out, bad);
  if (bad) return Error{ErrorCode::io, arguments.out.string() + ": cannot create the folder: " + bad.message()};
  std::vector<evaluation::StudyRow> rows;
  int failed = 0;
  // Seed by seed: what is there when somebody stops it has as many runs of each scenario as can be.
  for (int seed = arguments.first_seed; seed < arguments.first_seed + arguments.seeds; ++seed) {
    for (const std::string& scenario : *scenarios) {
      if (Result<void> done = run_one(arguments, scenario, static_cast<std::uint64_t>(seed), rows); !done) {
        std::fprintf(stderr, "adit: %s seed %d: %s\n", scenario.c_str(), seed, done.error().message.c_str());
        ++failed;
      }
      if (Result<void> written = write(arguments.out / "suite.json", evaluation::study_json(rows)); !written) {
        return written;
      }
    }
  }
  if (!rows.empty()) {
    const std::string table = evaluation::print_study(rows);
    std::fputs(table.c_str(), stdout);
    if (Result<void> written = write(arguments.out / "suite.txt", table); !written) return written;
  }
  if (failed > 0) return Error{ErrorCode::internal, std::to_string(failed) + " runs failed; see above"};
  return {};
}

}  // namespace

void add_suite_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(file_commands::suite.name, file_commands::suite.description);
  command->add_option("deployment", arguments->deployment, "deployment file")
      ->check(CLI::ExistingFile)
      ->capture_default_str();
  command->add_option("--scenarios", arguments->scenarios, "beginnings of file names, separated by commas")
      ->capture_default_str();
  command->add_option("--folder", arguments->folder, "of the scenario files")
      ->check(CLI::ExistingDirectory)
      ->capture_default_str();
  command->add_option("--seeds", arguments->seeds, "runs of each scenario, each with its own seed")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--first-seed", arguments->first_seed, "the others follow")->capture_default_str();
  command->add_option("--record", arguments->record,
                      "topic of the components or of the simulation to write to OUT/SCENARIO/SEED/bag (repeatable)");
  command
      ->add_option("--recorded", arguments->recorded,
                   "OUT of a suite run with --record: its bags take the place of the simulation")
      ->check(CLI::ExistingDirectory);
  command->add_option("--duration", arguments->duration_s, "stop each after this time [s]; 0: whole");
  command->add_option("--threads", arguments->threads, "of the simulation")->capture_default_str();
  command->add_option("--set", arguments->variables, "NAME=VALUE for ${NAME} in the file (repeatable)");
  command->add_option("--out", arguments->out, "folder: OUT/SCENARIO/SEED/, suite.json, suite.txt")->required();
  command->callback([arguments, &code] {
    if (Result<void> done = run(*arguments); !done) code = fail(done.error());
  });
}

}  // namespace adit
