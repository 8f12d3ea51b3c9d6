#include <cstdio>
#include <filesystem>

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
