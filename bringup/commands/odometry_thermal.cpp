#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "adit_msgs/msg/thermal_health.hpp"
#include "bringup/commands/command.hpp"
#include "bringup/commands/odometry_output.hpp"
#include "bringup/commands/thermal_folder.hpp"
#include "bringup/deployment/deployment.hpp"
#include "components/dataset/png8.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/image.hpp"

namespace adit {
namespace {

using nav_msgs::msg::Odometry;
using sensor_msgs::msg::Image;

struct Arguments {
  std::string input;
  std::string config;  // ROS 2 parameter file
  std::string prior;   // TUM, of base_link
  std::string estimate;
  std::string timing;
  std::string pictures;
  int every = 10;
  double file_rate = 30.0;
};

// What the parameter file says goes before what stands in the folder.
Result<Value::Map> parameters_of(const Arguments& arguments, const ThermalFolder& folder) {
  Value::Map parameters;
  if (!arguments.config.empty()) {
    Result<Value::Map> read = load_parameters(arguments.config, "thermal_odometry", "thermal_odometry");
    if (!read) return read.error();
    parameters = *std::move(read);
  }
  const auto given = [&parameters](const std::string& name) {
    return std::any_of(parameters.begin(), parameters.end(), [&](const auto& p) { return p.first == name; });
  };
  const bool own_camera = given("camera_matrix");
  for (const auto& [name, value] : folder.parameters) {
    const bool of_camera = name == "camera_matrix" || name == "image_size" || name == "distortion";
    if (given(name) || (of_camera && own_camera)) continue;
    parameters.emplace_back(name, value);
  }
  if (!given("camera_matrix")) {
    return Error{ErrorCode::invalid_argument,
                 arguments.input + ": no calib.txt, and no camera_matrix in a parameter file (--config)"};
  }
  return parameters;
}

Result<void> run_thermal(const Arguments& arguments) {
  Result<ThermalFolder> folder = open_thermal_folder(arguments.input, arguments.file_rate);
  if (!folder) return folder.error();
  Result<Value::Map> parameters = parameters_of(arguments, *folder);
  if (!parameters) return parameters.error();
  Trajectory prior;
  if (!arguments.prior.empty()) {
    Result<Trajectory> read = read_tum(arguments.prior);
    if (!read) return read.error();
    prior = *std::move(read);
  }
  ComponentConfig component;
  component.type = component.name = "thermal_odometry";
  component.parameters = Value(*std::move(parameters));
  Result<std::unique_ptr<OfflineRunner>> runner = OfflineRunner::build({component});
  if (!runner) return runner.error();

  Trajectory estimate;
  (*runner)->tap("/odometry", [&](const ErasedType&, const std::shared_ptr<const void>& message, const MessageInfo&) {
    estimate.push_back(stamped_pose(*static_cast<const Odometry*>(message.get())));
  });
  std::optional<Error> failed;
  int picture = 0;
  if (!arguments.pictures.empty()) {
    std::error_code error;
    std::filesystem::create_directories(arguments.pictures, error);
    if (error) return Error{ErrorCode::io, arguments.pictures + ": " + error.message()};
    (*runner)->tap("/points_image",
                   [&](const ErasedType&, const std::shared_ptr<const void>& message, const MessageInfo&) {
                     if (picture++ % arguments.every != 0) return;
                     char name[32];
                     std::snprintf(name, sizeof name, "/%06d.png", picture - 1);
                     const std::string path = arguments.pictures + name;
                     const auto& image = *static_cast<const Image*>(message.get());
                     if (Result<void> written =
                             dataset::write_png8(path, {image.width, image.height, 3, image.step, image.data.span()});
                         !written)
                       failed = written.error();
                   });
  }
  ThermalFolderSource source(*std::move(folder), std::move(prior));
  const Result<OfflineStats> done = (*runner)->run(source);
  if (!done) return done.error();
  if (failed) return *failed;
  if (Result<void> written = write_tum(arguments.estimate, estimate); !written) return written;
  if (!arguments.timing.empty()) {
    if (Result<void> written = write_timing(arguments.timing, source.timing()); !written) return written;
  }
  for (const ComponentStatus& status : (*runner)->status()) std::printf("%s\n", status.reason.c_str());
  std::printf("%zu of %zu frames have a pose; wrote %s\n", estimate.size(), source.frames(),
              arguments.estimate.c_str());
  return {};
}

}  // namespace

void add_thermal_odometry_command(CLI::App& command, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* thermal = command.add_subcommand("thermal", "thermal odometry on a folder of 16-bit images");
  thermal->add_option("--input", arguments->input, "folder (components/tunnel_simulator/README.md)")->required();
  thermal->add_option("--config", arguments->config, "parameters (ROS 2 parameter file)")->check(CLI::ExistingFile);
  thermal->add_option("--prior", arguments->prior, "odometry of base_link to start from (TUM)")
      ->check(CLI::ExistingFile);
  thermal->add_option("--out", arguments->estimate, "TUM file to write: the camera in its first pose")->required();
  thermal->add_option("--timing", arguments->timing, "CSV file for the milliseconds spent on each frame");
  thermal->add_option("--pictures", arguments->pictures, "folder for PNG files: frames with their points by depth");
  thermal->add_option("--every", arguments->every, "frames from picture to picture")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  thermal->add_option("--file-rate", arguments->file_rate, "of folders without stamps [Hz]")->capture_default_str();
  thermal->callback([arguments, &code] {
    if (Result<void> done = run_thermal(*arguments); !done) code = fail(done.error());
  });
}

}  // namespace adit
