#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "bringup/commands/file_commands.hpp"
#include "components/tunnel_simulator/bag_sink.hpp"
#include "components/tunnel_simulator/folder_writer.hpp"
#include "components/tunnel_simulator/scenario_loader.hpp"

namespace adit {
namespace {

using namespace tunnel_simulator;

struct Arguments {
  std::string scenario, out;
  std::string format = "folder";
  std::vector<std::string> sensors{"lidar", "thermal", "imu", "gnss"};
  std::optional<double> duration, speed;
  std::optional<std::uint64_t> seed;
  std::optional<int> columns;
  int threads = 1;
  bool plain_images = false;
};

Result<Scenario> configured(const Arguments& arguments) {
  Result<Scenario> scenario = load_scenario(arguments.scenario);
  if (!scenario) return scenario;
  if (arguments.seed) scenario->seed = *arguments.seed;
  if (arguments.speed) scenario->motion.speed = *arguments.speed;
  if (arguments.columns) scenario->lidar.beams.columns = *arguments.columns;
  if (arguments.duration) scenario->duration = std::min(scenario->duration, *arguments.duration);
  const auto keep = [&](bool& on, const char* name) {
    on = on && std::find(arguments.sensors.begin(), arguments.sensors.end(), name) != arguments.sensors.end();
  };
  keep(scenario->lidar_on, "lidar");
  keep(scenario->thermal_on, "thermal");
  keep(scenario->imu_on, "imu");
  keep(scenario->gnss_on, "gnss");
  return scenario;
}

// On a terminal: a bar, rewritten in place.
class Progress {
 public:
  explicit Progress(double duration) : duration_(duration) {}
  double seconds() const { return std::chrono::duration<double>(Steady::now() - begin_).count(); }
  void show(double simulated) const {
    if (!terminal_) return;
    const double wall = std::max(1e-3, seconds());
    const auto done = static_cast<int>(30.0 * simulated / duration_);
    const std::string bar =
        std::string(static_cast<std::size_t>(done), '#') + std::string(static_cast<std::size_t>(30 - done), '.');
    std::fprintf(stderr, "\r[%s] %.1f of %.1f s, %.2f x real time, %.0f s left   ", bar.c_str(), simulated, duration_,
                 simulated / wall, simulated > 0.0 ? wall * (duration_ - simulated) / simulated : 0.0);
  }
  void end() const {
    if (terminal_) std::fprintf(stderr, "\n");
  }

 private:
  using Steady = std::chrono::steady_clock;
  double duration_;
  bool terminal_ = ::isatty(STDERR_FILENO) != 0;
  Steady::time_point begin_ = Steady::now();
};

// Any of the writers: a Sink with finish().
template <class Writer>
Result<void> run_into(Simulation& simulation, Writer& writer, const std::string& out) {
  const double duration = simulation.scenario().duration;
  const Progress progress(duration);
  for (double time = 0.0; time < duration && !writer.stop();) {
    time = std::min(duration, time + 0.1);
    simulation.run(writer, time);
    progress.show(time);
  }
  progress.end();
  if (Result<void> finished = writer.finish(); !finished) return finished;
  std::printf("%s: %.1f s simulated in %.1f s, written to %s\n", simulation.scenario().name.c_str(), duration,
              progress.seconds(), out.c_str());
  return {};
}

Result<void> run(const Arguments& arguments) {
  Result<Scenario> scenario = configured(arguments);
  if (!scenario) return scenario.error();
  Result<std::unique_ptr<Simulation>> simulation = Simulation::create(*std::move(scenario), arguments.threads);
  if (!simulation) return simulation.error();
  if (arguments.format == "bag") {
    auto bag = BagSink::create(arguments.out, **simulation, arguments.plain_images);
    return bag ? run_into(**simulation, **bag, arguments.out) : bag.error();
  }
  auto folder = FolderWriter::open(arguments.out, **simulation);
  return folder ? run_into(**simulation, **folder, arguments.out) : folder.error();
}

}  // namespace

void add_simulate_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(file_commands::simulate.name, file_commands::simulate.description);
  command->add_option("scenario", arguments->scenario, "scenario file (bringup/scenarios)")->required();
  command->add_option("--out", arguments->out, "folder to write; an earlier run's files are replaced")->required();
  command->add_option("--format", arguments->format, "folder (components/tunnel_simulator/README.md) or bag (rosbag2)")
      ->check(CLI::IsMember({"folder", "bag"}))
      ->capture_default_str();
  command->add_option("--duration", arguments->duration, "at most the scenario's own [s]")->check(CLI::PositiveNumber);
  command->add_option("--seed", arguments->seed, "instead of the scenario's: the same seed makes the same bytes");
  command->add_option("--sensors", arguments->sensors, "comma-separated subset")
      ->delimiter(',')
      ->check(CLI::IsMember({"lidar", "thermal", "imu", "gnss"}))
      ->capture_default_str();
  command->add_option("--threads", arguments->threads, "for casting rays; the result does not depend on it")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command->add_option("--columns", arguments->columns, "LiDAR columns a sweep, instead of the scenario's")
      ->check(CLI::Range(16, 4096));
  command->add_option("--speed", arguments->speed, "of the vehicle, instead of the scenario's [m/s]")
      ->check(CLI::Range(0.05, 60.0));
  command->add_flag("--plain-images", arguments->plain_images, "bag: also /thermal/image_raw");
  command->callback([arguments, &code] {
    if (Result<void> done = run(*arguments); !done) code = fail(done.error());
  });
}

}  // namespace adit
