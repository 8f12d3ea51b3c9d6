#include <algorithm>
#include <cstdio>

#include "bringup/commands/file_commands.hpp"
#include "bringup/commands/lidar_recording.hpp"
#include "bringup/commands/odometry_output.hpp"
#include "bringup/deployment/deployment.hpp"
#include "components/geometry/trajectory.hpp"
#include "components/runtime/offline_runner.hpp"

namespace adit {
namespace {

using nav_msgs::msg::Odometry;

struct Arguments {
  std::string input;
  std::string config;  // ROS 2 parameter file
  std::string prior;   // TUM
  std::string imu;     // CSV
  std::string estimate;
  std::string timing;
  double file_rate = 10.0;
};

Result<void> run_lidar(const Arguments& arguments) {
  LidarRecordingOptions options{.file_rate = arguments.file_rate, .prior = {}, .imu = arguments.imu};
  if (!arguments.prior.empty()) {
    Result<Trajectory> read = read_tum(arguments.prior);
    if (!read) return read.error();
    options.prior = *std::move(read);
  }
  Result<std::unique_ptr<LidarRecording>> recording = LidarRecording::open(arguments.input, std::move(options));
  if (!recording) return recording.error();

  ComponentConfig component;
  component.type = component.name = "lidar_odometry";
  Value::Map parameters;
  if (!arguments.config.empty()) {
    Result<Value::Map> read = load_parameters(arguments.config, component.type, component.name);
    if (!read) return read.error();
    parameters = *std::move(read);
  }
  // What the parameter file says goes before what stands in the recording.
  const auto offer = [&parameters](const std::string& name, Value value) {
    const bool given =
        std::any_of(parameters.begin(), parameters.end(), [&](const auto& p) { return p.first == name; });
    if (!given) parameters.emplace_back(name, std::move(value));
  };
  for (const auto& [name, value] : (*recording)->parameters()) offer(name, value);
  if (!arguments.prior.empty()) parameters.emplace_back("use_prior", Value(true));
  if (!arguments.imu.empty()) offer("use_imu", Value(true));
  component.parameters = Value(std::move(parameters));

  Result<std::unique_ptr<OfflineRunner>> runner = OfflineRunner::build({component});
  if (!runner) return runner.error();
  Trajectory estimate;
  (*runner)->tap("/odometry", [&](const ErasedType&, const std::shared_ptr<const void>& message, const MessageInfo&) {
    estimate.push_back(stamped_pose(*static_cast<const Odometry*>(message.get())));
  });
  const Result<OfflineStats> done = (*runner)->run(**recording);
  if (!done) return done.error();
  if (Result<void> written = write_tum(arguments.estimate, estimate); !written) return written;
  const std::vector<FileTiming>& timing = (*recording)->timing();
  if (!arguments.timing.empty()) {
    if (Result<void> written = write_timing(arguments.timing, timing); !written) return written;
  }
  for (const ComponentStatus& status : (*runner)->status()) std::printf("%s\n", status.reason.c_str());
  std::printf("%zu of %zu clouds have a pose; wrote %s\n", estimate.size(), timing.size(), arguments.estimate.c_str());
  return {};
}

}  // namespace

void add_odometry_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(file_commands::odometry.name, file_commands::odometry.description);
  command->require_subcommand(1);
  CLI::App* lidar = command->add_subcommand("lidar", "LiDAR odometry on a folder of clouds or a bag");
  lidar->add_option("--input", arguments->input, "folder (components/dataset/README.md) or rosbag2 bag")->required();
  lidar->add_option("--config", arguments->config, "parameters (ROS 2 parameter file)")->check(CLI::ExistingFile);
  lidar->add_option("--prior", arguments->prior, "odometry of the sensor to start from (TUM)")
      ->check(CLI::ExistingFile);
  lidar
      ->add_option("--imu", arguments->imu,
                   "of a folder: CSV of stamp [ns], specific force [m/s^2], rate [rad/s]; bags have theirs (use_imu)")
      ->check(CLI::ExistingFile);
  lidar->add_option("--out", arguments->estimate, "TUM file to write")->required();
  lidar->add_option("--timing", arguments->timing, "CSV file for the milliseconds spent on each scan");
  lidar->add_option("--file-rate", arguments->file_rate, "of folders without stamps [Hz]")->capture_default_str();
  lidar->callback([arguments, &code] {
    if (Result<void> done = run_lidar(*arguments); !done) code = fail(done.error());
  });
  add_thermal_odometry_command(*command, code);
}

}  // namespace adit
