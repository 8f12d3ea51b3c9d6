#include <cstdio>
#include <filesystem>
#include <fstream>

#include <nlohmann/json.hpp>

#include "bringup/commands/command.hpp"
#include "bringup/evaluation/report.hpp"
#include "bringup/evaluation/summary.hpp"

namespace adit {
namespace {

namespace ev = evaluation;

struct Arguments {
  std::string truth;
  std::vector<std::string> estimates;  // NAME=FILE
  std::string out;
  std::string run;  // what `adit run --summary` wrote
  std::string alignment = "first_pose";
  ev::Options options;
};

Result<std::vector<ev::Evaluation>> evaluate_all(const Arguments& arguments, const Trajectory& truth) {
  std::vector<ev::Evaluation> evaluations;
  for (const std::string& argument : arguments.estimates) {
    const std::size_t equals = argument.find('=');
    if (equals == 0 || equals == std::string::npos) {
      return Error{ErrorCode::invalid_argument, "--estimate '" + argument + "': give NAME=FILE.tum"};
    }
    const std::string name = argument.substr(0, equals);
    const Result<Trajectory> estimate = read_tum(argument.substr(equals + 1));
    if (!estimate) return estimate.error();
    Result<ev::Evaluation> evaluation =
        estimate->empty() ? ev::nothing_delivered(name, truth) : ev::evaluate(truth, *estimate, arguments.options);
    if (!evaluation) return Error{evaluation.error().code, name + ": " + evaluation.error().message};
    evaluation->name = name;
    evaluations.push_back(*std::move(evaluation));
  }
  return evaluations;
}

// Adds a live run's links, CPU and real-time factor to the summary of its trajectories.
Result<void> add_run_figures(const std::string& summary_path, const std::string& run_path, double duration_s) {
  std::ifstream summary_file(summary_path), run_file(run_path);
  nlohmann::json summary = nlohmann::json::parse(summary_file, nullptr, false);
  const nlohmann::json run = nlohmann::json::parse(run_file, nullptr, false);
  if (!run.is_object() || !run.contains("wall_s")) {
    return Error{ErrorCode::malformed, run_path + ": not a file that `adit run --summary` wrote"};
  }
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

Result<void> run(Arguments& arguments) {
  const Result<ev::Alignment> alignment = ev::parse_alignment(arguments.alignment);
  if (!alignment) return alignment.error();
  arguments.options.alignment = *alignment;
  const Result<Trajectory> truth = read_tum(arguments.truth);
  if (!truth) return truth.error();
  const Result<std::vector<ev::Evaluation>> evaluations = evaluate_all(arguments, *truth);
  if (!evaluations) return evaluations.error();

  std::fputs(ev::print_table(*evaluations).c_str(), stdout);
  std::fputs(ev::print_drift_table(*evaluations).c_str(), stdout);
  if (arguments.out.empty()) return {};
  std::error_code bad;
  std::filesystem::create_directories(arguments.out, bad);
  if (bad) return Error{ErrorCode::io, arguments.out + ": cannot create the folder: " + bad.message()};
  if (Result<void> written = ev::write_summary(arguments.out + "/summary.json", *evaluations); !written) return written;
  if (Result<void> written = ev::write_report(arguments.out + "/report.html", *truth, *evaluations); !written) {
    return written;
  }
  if (!arguments.run.empty()) {
    const double duration_s = evaluations->front().truth_duration_s;
    if (Result<void> added = add_run_figures(arguments.out + "/summary.json", arguments.run, duration_s); !added) {
      return added;
    }
  }
  std::printf("wrote %s/summary.json and report.html\n", arguments.out.c_str());
  return {};
}

}  // namespace

void add_evaluate_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("evaluate", "compare trajectories with the truth: table, summary.json, report.html");
  command->add_option("--truth", arguments->truth, "TUM file")->required()->check(CLI::ExistingFile);
  command->add_option("--estimate", arguments->estimates, "NAME=FILE.tum (repeatable)")->required();
  command->add_option("--out", arguments->out, "folder for summary.json and report.html");
  command->add_option("--run", arguments->run, "figures of the live run (adit run --summary) to add to summary.json")
      ->check(CLI::ExistingFile);
  command->add_option("--align", arguments->alignment, "none, first_pose, se3 or sim3")->capture_default_str();
  command->add_flag("--yaw-only", arguments->options.yaw_only,
                    "restrict the alignment's rotation to the vertical axis");
  command
      ->add_option("--max-truth-gap", arguments->options.max_truth_gap_s,
                   "interpolate the truth over pauses up to this [s]")
      ->capture_default_str();
  command->callback([arguments, &code] {
    if (Result<void> done = run(*arguments); !done) code = fail(done.error());
  });
}

}  // namespace adit
