// simulate_folder SCENARIO.yaml --out DIR: runs a scenario into plain files for the offline tools.
#include <chrono>
#include <cstdio>

#include <CLI/CLI.hpp>

#include "components/tunnel_simulator/folder_writer.hpp"
#include "components/tunnel_simulator/scenario_loader.hpp"

using namespace adit::tunnel_simulator;

int main(int argc, char** argv) {
  CLI::App app{"Runs a tunnel scenario and writes scans, thermal images, IMU, GNSS and ground truth into a folder"};
  std::string path, out, sensors = "lidar,thermal,imu,gnss";
  double duration = 1e9, speed = -1.0;
  int threads = 1, columns = 0;
  long seed = -1;
  app.add_option("scenario", path, "scenario file")->required();
  app.add_option("--out", out, "folder to write into")->required();
  app.add_option("--duration", duration, "seconds, at most the scenario's own");
  app.add_option("--seed", seed, "instead of the scenario's");
  app.add_option("--threads", threads, "for casting; the result does not depend on it");
  app.add_option("--sensors", sensors, "comma-separated subset of lidar,thermal,imu,gnss");
  app.add_option("--columns", columns, "LiDAR columns a sweep instead of the scenario's (smaller files)");
  app.add_option("--speed", speed, "m/s, instead of the scenario's");
  CLI11_PARSE(app, argc, argv);

  auto scenario = load_scenario(path);
  if (!scenario) {
    std::fprintf(stderr, "%s\n", scenario.error().message.c_str());
    return 2;
  }
  if (seed >= 0) scenario->seed = static_cast<std::uint64_t>(seed);
  if (speed > 0.0) scenario->motion.speed = speed;
  if (columns > 0) scenario->lidar.beams.columns = columns;
  const auto wanted = [&](const char* name) { return sensors.find(name) != std::string::npos; };
  scenario->lidar_on = scenario->lidar_on && wanted("lidar");
  scenario->thermal_on = scenario->thermal_on && wanted("thermal");
  scenario->imu_on = scenario->imu_on && wanted("imu");
  scenario->gnss_on = scenario->gnss_on && wanted("gnss");
  scenario->duration = std::min(scenario->duration, duration);

  auto simulation = Simulation::create(std::move(*scenario), threads);
  if (!simulation) {
    std::fprintf(stderr, "%s\n", simulation.error().message.c_str());
    return 2;
  }
  auto writer = FolderWriter::open(out, **simulation);
  if (!writer) {
    std::fprintf(stderr, "%s\n", writer.error().message.c_str());
    return 1;
  }
  const auto begin = std::chrono::steady_clock::now();
  (*simulation)->run(**writer, duration);
  if (auto finished = (*writer)->finish(); !finished) {
    std::fprintf(stderr, "%s\n", finished.error().message.c_str());
    return 1;
  }
  const double wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const double simulated = (*simulation)->scenario().duration;
  std::printf("%s: %.1f s simulated in %.1f s, written to %s\n", (*simulation)->scenario().name.c_str(), simulated,
              wall, out.c_str());
  return 0;
}
