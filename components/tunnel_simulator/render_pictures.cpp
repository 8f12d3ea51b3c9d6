// render_pictures SCENARIO.yaml --out FILE.png --what thermal|above|inside|map [--time S]: pictures for the
// documentation and for looking at a scenario before it is run.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include <CLI/CLI.hpp>

#include "components/dataset/png8.hpp"
#include "components/tunnel_simulator/scenario_loader.hpp"
#include "components/tunnel_simulator/simulation.hpp"

using namespace adit::tunnel_simulator;
using adit::Pose;

namespace {

struct Picture {
  int width, height;
  std::vector<std::uint8_t> rgb;
  Picture(int w, int h, std::array<std::uint8_t, 3> fill) : width(w), height(h) {
    for (int i = 0; i < w * h; ++i) rgb.insert(rgb.end(), fill.begin(), fill.end());
  }
  void set(int x, int y, std::array<std::uint8_t, 3> color) {
    if (x < 0 || y < 0 || x >= width || y >= height) return;
    std::copy(color.begin(), color.end(), rgb.begin() + 3 * (static_cast<std::ptrdiff_t>(y) * width + x));
  }
  void dot(double x, double y, int radius, std::array<std::uint8_t, 3> color) {
    for (int dy = -radius; dy <= radius; ++dy) {
      for (int dx = -radius; dx <= radius; ++dx)
        set(static_cast<int>(std::lround(x)) + dx, static_cast<int>(std::lround(y)) + dy, color);
    }
  }
  // Means of 2 x 2 pixels.
  Picture halved() const {
    Picture half(width / 2, height / 2, {0, 0, 0});
    for (int y = 0; y < half.height; ++y) {
      for (int x = 0; x < half.width; ++x) {
        std::array<std::uint8_t, 3> mean{};
        for (std::size_t c = 0; c < 3; ++c) {
          const auto at = [&](int px, int py) { return rgb[3 * static_cast<std::size_t>(py * width + px) + c]; };
          mean[c] = static_cast<std::uint8_t>(
              (at(2 * x, 2 * y) + at(2 * x + 1, 2 * y) + at(2 * x, 2 * y + 1) + at(2 * x + 1, 2 * y + 1)) / 4);
        }
        half.set(x, y, mean);
      }
    }
    return half;
  }
  bool write(const std::string& path) const {
    return static_cast<bool>(adit::dataset::write_png8(
        path, {static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height), 3, 0, rgb}));
  }
};

// Dark blue over green to yellow, monotonic in brightness.
std::array<std::uint8_t, 3> ramp(double t) {
  static constexpr std::array<std::array<double, 3>, 5> kStops{
      {{24, 20, 60}, {44, 80, 140}, {35, 145, 140}, {120, 205, 90}, {253, 231, 37}}};
  t = std::clamp(t, 0.0, 1.0) * 4.0;
  const auto i = std::min<std::size_t>(3, static_cast<std::size_t>(t));
  std::array<std::uint8_t, 3> out{};
  for (std::size_t c = 0; c < 3; ++c) {
    out[c] = static_cast<std::uint8_t>(kStops[i][c] + (t - static_cast<double>(i)) * (kStops[i + 1][c] - kStops[i][c]));
  }
  return out;
}

LidarScan scan_at(Simulation& simulation, double time) {
  Lidar lidar(simulation.scenario().lidar, 1);
  LidarScan scan;
  simulation.caster().look_from(simulation.lidar(time).translation());
  lidar.sweep(
      simulation.caster(), {}, [&](double t) { return simulation.lidar(t); }, time, 0, 1, scan);
  return scan;
}

Picture thermal(Simulation& simulation, double time, double low_percent, double high_percent) {
  ThermalCamera camera(simulation.scenario().thermal, 1);
  ThermalImage image;
  simulation.caster().look_from(simulation.thermal(time).translation());
  camera.capture(
      simulation.caster(), {}, [&](double t) { return simulation.thermal(t); }, time, 0, 1, image);
  std::vector<std::uint16_t> sorted = image.counts;
  std::sort(sorted.begin(), sorted.end());
  const auto at = [&](double percent) {
    return static_cast<double>(
        sorted[static_cast<std::size_t>(percent / 100.0 * static_cast<double>(sorted.size() - 1))]);
  };
  const double low = at(low_percent);
  const double high = std::max(low + 10.0, at(high_percent));
  std::printf("counts %u .. %u, shown %.0f .. %.0f\n", sorted.front(), sorted.back(), low, high);
  Picture picture(image.width, image.height, {0, 0, 0});
  for (int i = 0; i < image.width * image.height; ++i) {
    const auto grey = static_cast<std::uint8_t>(
        255.0 * std::clamp((image.counts[static_cast<std::size_t>(i)] - low) / (high - low), 0.0, 1.0));
    picture.set(i % image.width, i / image.width, {grey, grey, grey});
  }
  return picture;
}

Picture above(Simulation& simulation, double time) {
  const LidarScan scan = scan_at(simulation, time);
  Picture picture(900, 450, {255, 255, 255});
  for (const Eigen::Vector3f& p : scan.points) {
    if (p.isZero()) continue;
    picture.dot(450.0 + 9.0 * static_cast<double>(p.x()), 225.0 - 9.0 * static_cast<double>(p.y()), 0,
                ramp((p.z() + 2.0) / 7.0));
  }
  std::printf("%zu returns\n", scan.returns());
  return picture;
}

Picture inside(Simulation& simulation, double time) {
  const LidarScan scan = scan_at(simulation, time);
  Picture picture(800, 500, {0, 0, 0});
  std::vector<double> depth(800 * 500, std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const Eigen::Vector3d p = scan.points[i].cast<double>() + Eigen::Vector3d(6.0, 0.0, 0.0);  // seen from behind
    if (scan.ranges[i] <= 0.0F || p.x() < 0.5) continue;
    const double x = 400.0 - 420.0 * p.y() / p.x();
    const double y = 250.0 - 420.0 * p.z() / p.x();
    const int radius = p.x() < 12.0 ? 1 : 0;
    if (x < 0 || y < 0 || x >= 800 || y >= 500) continue;
    double& nearest = depth[static_cast<std::size_t>(y) * 800 + static_cast<std::size_t>(x)];
    if (p.x() > nearest) continue;
    nearest = p.x();
    picture.dot(x, y, radius, ramp(static_cast<double>(scan.reflectivity[i]) / 60.0));
  }
  return picture;
}

Picture map(const Simulation& simulation) {
  Eigen::AlignedBox2d box;
  for (const Chunk& c : simulation.world().chunks()) {
    box.extend(Eigen::Vector2d(c.bounds.min().head<2>()));
    box.extend(Eigen::Vector2d(c.bounds.max().head<2>()));
  }
  const double scale = std::min(1100.0 / box.sizes().x(), 700.0 / box.sizes().y());
  const int width = static_cast<int>(box.sizes().x() * scale) + 20;
  const int height = static_cast<int>(box.sizes().y() * scale) + 20;
  Picture picture(width, height, {255, 255, 255});
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double wx = box.min().x() + (x - 10) / scale;
      const double wy = box.max().y() - (y - 10) / scale;
      for (double z : {1.2, 3.0, 4.8, 6.5, 8.0}) {
        if (simulation.world().field({wx, wy, z}, true) < 0.0) picture.set(x, y, {170, 175, 185});
      }
      if (simulation.world().field({wx, wy, 1.2}) < 0.0 && simulation.world().field({wx, wy, 1.2}, true) > 0.0)
        picture.set(x, y, {225, 232, 215});
    }
  }
  for (double d = 0.0; d < simulation.route().length(); d += 0.3) {
    const Eigen::Vector3d p = simulation.route().at(d).position;
    picture.dot(10 + (p.x() - box.min().x()) * scale, 10 + (box.max().y() - p.y()) * scale, 1, {200, 30, 30});
  }
  std::printf("route %.1f m\n", simulation.route().length());
  return picture;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Draws what a scenario looks like"};
  std::string path, out, what = "thermal";
  double time = 10.0, low = 0.5, high = 99.5;
  bool half = false;
  int texture = -1;
  app.add_option("scenario", path, "scenario file")->required();
  app.add_option("--out", out, "PNG file")->required();
  app.add_option("--what", what, "thermal, above, inside or map")
      ->check(CLI::IsMember({"thermal", "above", "inside", "map"}));
  app.add_option("--time", time, "seconds after the start");
  app.add_option("--low", low, "percentile shown black");
  app.add_option("--high", high, "percentile shown white");
  app.add_flag("--half", half, "half the size");
  app.add_option("--texture", texture, "0 to 3 instead of the scenario's level");
  CLI11_PARSE(app, argc, argv);
  auto scenario = load_scenario(path);
  if (scenario && texture >= 0) scenario->world.texture = texture;
  auto simulation = scenario ? Simulation::create(std::move(*scenario), 1) : scenario.error();
  if (!simulation) {
    std::fprintf(stderr, "%s\n", simulation.error().message.c_str());
    return 2;
  }
  const Picture picture = what == "thermal"  ? thermal(**simulation, time, low, high)
                          : what == "above"  ? above(**simulation, time)
                          : what == "inside" ? inside(**simulation, time)
                                             : map(**simulation);
  if ((half ? picture.halved() : picture).write(out)) return 0;
  std::fprintf(stderr, "%s: cannot be written\n", out.c_str());
  return 1;
}
