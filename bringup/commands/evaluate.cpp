#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "bringup/commands/evaluation_report.hpp"
#include "bringup/commands/file_commands.hpp"
#ifdef ADIT_HAS_SIMULATOR
#include "bringup/offline/scenario_description.hpp"
#endif

namespace adit {
namespace {

namespace ev = evaluation;

struct Arguments {
  std::string truth;
  std::vector<std::string> estimates;  // NAME=FILE
  std::string folder;                  // instead of the two
  std::string scenario, centre_line;
  std::vector<std::string> pictures;
  std::string out;
  std::string run;  // what `adit run --summary` wrote
  std::string alignment = "first_pose";
  ev::Options options;
};

Result<ev::RunFolder> evaluate_files(const Arguments& arguments) {
  ev::RunFolder run;
  Result<Trajectory> truth = read_tum(arguments.truth);
  if (!truth) return truth.error();
  run.truth = *std::move(truth);
  for (const std::string& argument : arguments.estimates) {
    const std::size_t equals = argument.find('=');
    if (equals == 0 || equals == std::string::npos) {
      return Error{ErrorCode::invalid_argument, "--estimate '" + argument + "': give NAME=FILE.tum"};
    }
    Result<ev::Evaluation> evaluation =
        ev::evaluate_file(argument.substr(0, equals), argument.substr(equals + 1), run.truth, arguments.options);
    if (!evaluation) return evaluation.error();
    run.evaluations.push_back(*std::move(evaluation));
  }
  return run;
}

Result<std::vector<Eigen::Vector2d>> read_line(const std::string& path) {
  std::ifstream file(path);
  std::vector<Eigen::Vector2d> points;
  for (double x = 0.0, y = 0.0; file >> x >> y;) points.emplace_back(x, y);
  if (!file.eof() || points.size() < 2) {
    return Error{ErrorCode::malformed, path + ": expected at least two points, two numbers each"};
  }
  return points;
}

Result<void> run(Arguments& arguments) {
  const Result<ev::Alignment> alignment = ev::parse_alignment(arguments.alignment);
  if (!alignment) return alignment.error();
  arguments.options.alignment = *alignment;
  ev::ReportOptions report;
  if (!arguments.scenario.empty()) {
#ifdef ADIT_HAS_SIMULATOR
    if (Result<void> described = offline::describe_scenario(arguments.scenario, arguments.options, report);
        !described) {
      return described;
    }
#else
    return Error{ErrorCode::unavailable, "--scenario: built without the simulator"};
#endif
  }
  if (!arguments.centre_line.empty()) {
    Result<std::vector<Eigen::Vector2d>> line = read_line(arguments.centre_line);
    if (!line) return line.error();
    arguments.options.centre_line = *std::move(line);
  }
  if (arguments.folder.empty() == arguments.estimates.empty()) {
    return Error{ErrorCode::invalid_argument, "give --truth and --estimate, or --folder"};
  }
  if (arguments.folder.empty() && arguments.truth.empty()) {
    return Error{ErrorCode::invalid_argument, "--estimate needs --truth"};
  }
  Result<ev::RunFolder> evaluated =
      arguments.folder.empty() ? evaluate_files(arguments) : ev::evaluate_folder(arguments.folder, arguments.options);
  if (!evaluated) return evaluated.error();
  if (arguments.out.empty()) arguments.out = arguments.folder;
  if (!arguments.run.empty()) {
    if (Result<void> added = add_run_figures(arguments.run, evaluated->evaluations); !added) return added;
  }
  for (const std::string& picture : arguments.pictures) {
    std::ifstream file(picture, std::ios::binary);
    std::ostringstream bytes;
    if (!file || !(bytes << file.rdbuf())) return Error{ErrorCode::io, picture + ": cannot read"};
    std::string caption = std::filesystem::path(picture).stem().string();
    std::replace(caption.begin(), caption.end(), '_', ' ');
    report.pictures.push_back({std::move(caption), bytes.str()});
  }
  report.fusion = evaluated->fusion;
  return report_evaluations(*evaluated, report, arguments.run, arguments.out);
}

}  // namespace

void add_evaluate_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(file_commands::evaluate.name, file_commands::evaluate.description);
  command->add_option("--truth", arguments->truth, "TUM file")->check(CLI::ExistingFile);
  command->add_option("--estimate", arguments->estimates,
                      "NAME=FILE.tum (repeatable); with a FILE.cov beside it also NEES");
  command->add_option("--folder", arguments->folder, "instead: a run's folder, truth.tum and NAME.tum files")
      ->check(CLI::ExistingDirectory);
  command->add_option("--out", arguments->out, "folder for summary.json and report.html (default: that of --folder)");
  command->add_option("--scenario", arguments->scenario, "scenario of the run: its map, outages, route and sensors")
      ->check(CLI::ExistingFile);
  command
      ->add_option("--centre-line", arguments->centre_line,
                   "line for axial and lateral errors: a text file, x y [m] a line")
      ->check(CLI::ExistingFile);
  command->add_option("--picture", arguments->pictures, "PNG file to show in the report (repeatable)")
      ->check(CLI::ExistingFile);
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
