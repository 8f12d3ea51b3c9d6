#include <unistd.h>

#include <chrono>
#include <cstdio>

#include "bringup/commands/file_commands.hpp"
#include "bringup/commands/odometry_output.hpp"
#include "bringup/deployment/deployment.hpp"
#include "components/dataset/dataset.hpp"
#include "components/dataset/pcd_file.hpp"
#include "components/dataset_player/recorded_messages.hpp"
#include "components/geometry/trajectory.hpp"
#include "components/runtime/offline_runner.hpp"

namespace adit {
namespace {

using nav_msgs::msg::Odometry;
using sensor_msgs::msg::PointCloud2;

struct Arguments {
  std::string input;
  std::string config;  // ROS 2 parameter file
  std::string prior;   // TUM
  std::string estimate;
  std::string timing;
  double file_rate = 10.0;
};

// The files of a folder in the order of their stamps, each after the prior pose of its stamp. Notes how long the
// components worked on each file: the time from handing it out to being asked for the next message.
class FolderSource final : public OfflineSource {
 public:
  FolderSource(dataset::Dataset dataset, Trajectory prior) : dataset_(std::move(dataset)), prior_(std::move(prior)) {}

  Result<bool> next(OfflineMessage& out) override {
    if (handed_out_) {
      timing_.push_back({dataset_.entries[next_ - 1].stamp_ns,
                         std::chrono::duration<double, std::milli>(Steady::now() - *handed_out_).count()});
      handed_out_.reset();
    }
    if (next_ == dataset_.entries.size()) return false;
    const dataset::Entry& entry = dataset_.entries[next_];
    const Time stamp{Duration(entry.stamp_ns)};
    if (const std::optional<Pose> pose = interpolate(prior_, entry.stamp_ns); pose && !prior_sent_) {
      auto message = std::make_shared<Odometry>();
      dataset_player::fill(StampedPose{entry.stamp_ns, *pose}, "odom", "lidar", *message);
      out = offline_message<Odometry>("/prior", stamp, std::move(message));
      prior_sent_ = true;
      return true;
    }
    const Result<dataset::PointFile> file = dataset_.kind == dataset::Dataset::Kind::pcd
                                                ? dataset::read_pcd(entry.path)
                                                : dataset::read_bin(entry.path, entry.points);
    if (!file) return file.error();
    auto message = std::make_shared<PointCloud2>();
    dataset_player::fill(*file, stamp, "lidar", *message);
    out = offline_message<PointCloud2>("/points", stamp, std::move(message));
    ++next_;
    prior_sent_ = false;
    show_progress();
    handed_out_ = Steady::now();
    return true;
  }

  const std::vector<FileTiming>& timing() const { return timing_; }
  const dataset::Dataset& dataset() const { return dataset_; }

 private:
  using Steady = std::chrono::steady_clock;
  void show_progress() const {
    if (!::isatty(STDERR_FILENO)) return;
    const std::size_t total = dataset_.entries.size();
    std::fprintf(stderr, "\r%zu of %zu files%s", next_, total, next_ == total ? "\n" : "");
  }

  dataset::Dataset dataset_;
  Trajectory prior_;
  std::size_t next_ = 0;
  bool prior_sent_ = false;
  std::optional<Steady::time_point> handed_out_;
  std::vector<FileTiming> timing_;
};

Result<void> run_lidar(const Arguments& arguments) {
  Result<dataset::Dataset> dataset = dataset::open_dataset(arguments.input, arguments.file_rate);
  if (!dataset) return dataset.error();
  if (dataset->kind == dataset::Dataset::Kind::png16) {
    return Error{ErrorCode::invalid_argument, arguments.input + " holds images, not clouds"};
  }
  ComponentConfig component;
  component.type = component.name = "lidar_odometry";
  Value::Map parameters;
  if (!arguments.config.empty()) {
    Result<Value::Map> read = load_parameters(arguments.config, component.type, component.name);
    if (!read) return read.error();
    parameters = *std::move(read);
  }
  Trajectory prior;
  if (!arguments.prior.empty()) {
    Result<Trajectory> read = read_tum(arguments.prior);
    if (!read) return read.error();
    prior = *std::move(read);
    parameters.emplace_back("use_prior", Value(true));
  }
  component.parameters = Value(std::move(parameters));

  Result<std::unique_ptr<OfflineRunner>> runner = OfflineRunner::build({component});
  if (!runner) return runner.error();
  Trajectory estimate;
  (*runner)->tap("/odometry", [&](const ErasedType&, const std::shared_ptr<const void>& message, const MessageInfo&) {
    estimate.push_back(stamped_pose(*static_cast<const Odometry*>(message.get())));
  });
  FolderSource source(*std::move(dataset), std::move(prior));
  const Result<OfflineStats> done = (*runner)->run(source);
  if (!done) return done.error();
  if (Result<void> written = write_tum(arguments.estimate, estimate); !written) return written;
  if (!arguments.timing.empty()) {
    if (Result<void> written = write_timing(arguments.timing, source.timing()); !written) return written;
  }
  std::printf("%zu of %zu clouds have a pose; wrote %s\n", estimate.size(), source.dataset().entries.size(),
              arguments.estimate.c_str());
  return {};
}

}  // namespace

void add_odometry_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(file_commands::odometry.name, file_commands::odometry.description);
  command->require_subcommand(1);
  CLI::App* lidar = command->add_subcommand("lidar", "LiDAR odometry on a folder of clouds");
  lidar->add_option("--input", arguments->input, "folder (components/dataset/README.md)")->required();
  lidar->add_option("--config", arguments->config, "parameters (ROS 2 parameter file)")->check(CLI::ExistingFile);
  lidar->add_option("--prior", arguments->prior, "odometry of the sensor to start from (TUM)")
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
