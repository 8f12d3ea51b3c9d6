#include "bringup/offline/scenario_description.hpp"

#include <cmath>
#include <cstdarg>
#include <cstdio>

#include "components/tunnel_simulator/route.hpp"
#include "components/tunnel_simulator/scenario_loader.hpp"

namespace adit::offline {
namespace {

namespace sim = tunnel_simulator;

std::string text(const char* format, ...) __attribute__((format(printf, 1, 2)));
std::string text(const char* format, ...) {
  char buffer[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer, sizeof buffer, format, arguments);
  va_end(arguments);
  return buffer;
}

const char* name_of(sim::Sensor sensor) {
  switch (sensor) {
    case sim::Sensor::lidar:
      return "LiDAR";
    case sim::Sensor::thermal:
      return "thermal camera";
    case sim::Sensor::imu:
      return "IMU";
    case sim::Sensor::gnss:
      return "GNSS";
  }
  return "?";
}

std::string timing(const sim::Scenario& scenario, sim::Sensor sensor) {
  const sim::Timing& t = scenario.timing[static_cast<std::size_t>(sensor)];
  std::string out;
  if (t.offset != 0.0) out += text(", stamps off by %.0f ms", 1e3 * t.offset);
  if (t.jitter > 0.0) out += text(", jitter %.1f ms", 1e3 * t.jitter);
  if (t.latency_high > 0.0) out += text(", latency %.0f to %.0f ms", 1e3 * t.latency_low, 1e3 * t.latency_high);
  if (t.loss > 0.0) out += text(", %.0f %% lost", 100.0 * t.loss);
  return out;
}

std::string failures(const sim::Scenario& scenario) {
  std::string out;
  for (const sim::Outage& o : scenario.outages) {
    const char* const how = o.mode == sim::OutageMode::off       ? "off"
                            : o.mode == sim::OutageMode::frozen  ? "frozen"
                            : o.mode == sim::OutageMode::delayed ? "delayed"
                                                                 : "lossy";
    out += text("%s%s %s %.1f to %.1f s", out.empty() ? "" : "; ", name_of(o.sensor), how, o.from, o.from + o.duration);
  }
  for (const sim::Smoke& s : scenario.smoke) {
    out +=
        text("%s%s of %.0f m visibility in %s from %.0f to %.0f m", out.empty() ? "" : "; ",
             s.kind == sim::Obscurant::soot ? "soot smoke" : "water fog", s.visibility, s.tube.c_str(), s.from, s.to);
  }
  return out.empty() ? "none" : out;
}

std::vector<std::vector<Eigen::Vector2d>> walls(const sim::WorldDescription& world) {
  std::vector<std::vector<Eigen::Vector2d>> lines;
  for (const sim::VolumeDescription& volume : world.volumes) {
    if (volume.line.length() < 5.0) continue;  // niches
    for (const double side : {volume.profile.min().x(), volume.profile.max().x()}) {
      std::vector<Eigen::Vector2d>& line = lines.emplace_back();
      const int steps = static_cast<int>(std::ceil(volume.line.length() / 2.0));
      for (int i = 0; i <= steps; ++i) {
        line.push_back(volume.line.point(volume.line.length() * i / steps, side, 0.0).head<2>());
      }
    }
  }
  return lines;
}

}  // namespace

Result<void> describe_scenario(const std::string& path, evaluation::Options& options,
                               evaluation::ReportOptions& report) {
  const Result<sim::Scenario> loaded = sim::load_scenario(path);
  if (!loaded) return loaded.error();
  const sim::Scenario& s = *loaded;
  const sim::Route route(s.route, s.closed);
  report.title = s.name;
  report.description = s.description;
  report.map = walls(s.world);
  for (double at = 0.0; at < route.length(); at += 1.0) {
    options.centre_line.push_back(route.at(at).position.head<2>());
  }
  for (const sim::Outage& o : s.outages) {
    const auto at = [&](double seconds) { return std::llround((s.epoch + seconds) * 1e9); };
    report.outages_ns.emplace_back(at(o.from), at(o.from + o.duration));
  }

  auto& in = report.inputs;
  in.emplace_back("World", text("%s, texture TT%d", s.world.name.c_str(), s.world.texture));
  in.emplace_back("Route", text("%.0f m%s, %s at %.1f m/s", route.length(), s.closed ? " a lap, closed" : "",
                                s.motion.kind == sim::VehicleKind::car ? "car" : "walking robot", s.motion.speed));
  if (s.lidar_on) {
    const auto& beams = s.lidar.beams;
    const double top = beams.elevation.front(), bottom = beams.elevation.back();
    in.emplace_back(
        "LiDAR", text("%zu x %d points, %.2f degrees vertical, %g Hz, range noise %.1f cm", beams.elevation.size(),
                      beams.columns, std::abs(top - bottom) * 180.0 / M_PI, s.lidar.rate, 100.0 * s.lidar.range_sigma) +
                     timing(s, sim::Sensor::lidar));
  }
  if (s.thermal_on) {
    const auto& c = s.thermal;
    in.emplace_back("Thermal camera",
                    text("%d x %d, 16 bit, %g Hz, NETD %.0f mK, rolling readout %.1f ms, FFC of %.1f s at %.0f s, then "
                         "every %.0f s",
                         c.camera.width, c.camera.height, c.rate, 1e3 * c.netd, 1e3 * c.row_time * c.camera.height,
                         c.ffc_duration, c.ffc_first, c.ffc_interval) +
                        timing(s, sim::Sensor::thermal));
  }
  if (s.imu_on) in.emplace_back("IMU", text("%g Hz (recorded; fused only where the deployment says so)", s.imu.rate));
  if (s.gnss_on) in.emplace_back("GNSS", text("%g Hz in the open, none inside", s.gnss.rate));
  in.emplace_back("Failures", failures(s));
  in.emplace_back("Ground truth", "pose of the simulator, exact, 100 Hz");
  return {};
}

std::string vehicle_of(const std::string& path) {
  const Result<sim::Scenario> scenario = sim::load_scenario(path);
  return scenario && scenario->motion.kind == sim::VehicleKind::legged ? "legged" : "car";
}

}  // namespace adit::offline
