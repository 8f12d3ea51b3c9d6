#include "components/lidar_odometry/test_scene.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace adit::lidar_odometry {
namespace {

constexpr double max_distance = 120.0;

// Distances at which a line enters and leaves a box; enter > leave: it misses.
std::pair<double, double> crossing(const Box& box, const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) {
  double enter = -1e30;
  double leave = 1e30;
  for (int i = 0; i < 3; ++i) {
    const double a = (box.low[i] - origin[i]) / ray[i];
    const double b = (box.high[i] - origin[i]) / ray[i];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return {enter, leave};
}

}  // namespace

double Scene::range(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) const {
  double best = max_distance;
  for (const Box& room : rooms) {
    const double leave = crossing(room, origin, ray).second;
    if (leave > 0.0) best = std::min(best, leave);
  }
  for (const Box& solid : solids) {
    const auto [enter, leave] = crossing(solid, origin, ray);
    if (enter > 0.0 && enter < leave) best = std::min(best, enter);
  }
  if (tunnel_radius > 0.0) {
    const double a = ray.tail<2>().squaredNorm();
    const double b = origin.tail<2>().dot(ray.tail<2>());
    const double c = origin.tail<2>().squaredNorm() - tunnel_radius * tunnel_radius;
    // Rays that graze the wall at less than 2.3 degrees give no return.
    if (a > 0.0016) best = std::min(best, (-b + std::sqrt(b * b - a * c)) / a);
  }
  return best < max_distance ? best : 0.0;
}

Scene hall() {
  Scene scene;
  scene.rooms.push_back({{-12.0, -8.0, -1.5}, {12.0, 8.0, 5.5}});
  scene.solids = {{{3.0, 4.0, -1.5}, {5.0, 6.0, 1.5}},   {{-6.0, -7.0, -1.5}, {-4.5, -5.0, 3.0}},
                  {{7.0, -5.0, -1.5}, {9.0, -3.5, 0.5}}, {{-9.0, 3.0, -1.5}, {-8.0, 7.0, 2.0}},
                  {{-2.0, 6.5, 2.0}, {2.0, 8.0, 3.0}},   {{1.0, -8.0, 0.0}, {1.5, -7.0, 5.5}}};
  return scene;
}

Scene smooth_tunnel() {
  Scene scene;
  scene.tunnel_radius = 4.0;
  scene.solids = {{{-1e4, -5.0, -5.0}, {1e4, 5.0, -1.6}},
                  {{-1e4, -5.0, -1.6}, {1e4, -2.9, -1.35}},
                  {{-1e4, 2.9, -1.6}, {1e4, 5.0, -1.35}}};
  return scene;
}

Scene furnished_tunnel(double first, double last) {
  Scene scene = smooth_tunnel();
  for (int i = -60; i <= 400; ++i) {
    const double x = 3.1 * i + 0.7 * std::sin(5.0 * i);
    if (x < first || x > last) continue;
    const double side = i % 2 == 0 ? 1.0 : -1.0;
    const double low = -1.0 + 0.5 * std::sin(3.0 * i);
    const Eigen::Vector3d a(x, 3.3 * side, low);
    const Eigen::Vector3d b(x + 0.6 + 0.3 * std::cos(i), 4.2 * side, low + 1.4);
    scene.solids.push_back({a.cwiseMin(b), a.cwiseMax(b)});
  }
  return scene;
}

RecordedSweep scan(const Scene& scene, const ScannerModel& model, const Pose& end, const Vector6d& twist,
                   std::int64_t stamp_ns, unsigned seed) {
  return scan(
      scene, model, [&](double time) { return end * se3_exp((time / model.period - 1.0) * model.period * twist); },
      stamp_ns, seed);
}

RecordedSweep scan(const Scene& scene, const ScannerModel& model, const std::function<Pose(double)>& pose_at,
                   std::int64_t stamp_ns, unsigned seed) {
  const auto rows = static_cast<std::size_t>(model.rings);
  const auto columns = static_cast<std::size_t>(model.columns);
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  RecordedSweep sweep;
  sweep.stamp_ns = stamp_ns;
  sweep.width = columns;
  sweep.height = rows;
  sweep.points.assign(rows * columns, Point3f(nan, nan, nan));
  if (model.times) sweep.seconds.assign(rows * columns, 0.0f);
  std::mt19937 generator(seed);
  // Sum of uniform numbers: near enough to normal, and the same in every standard library.
  const auto noise = [&] {
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) sum += static_cast<double>(generator()) / 4294967296.0;
    return model.noise * sum;
  };
  for (std::size_t c = 0; c < columns; ++c) {
    const double fraction = static_cast<double>(c) / static_cast<double>(columns - 1);
    const Pose pose = pose_at(fraction * model.period);
    const double azimuth =
        std::numbers::pi - 2.0 * std::numbers::pi * static_cast<double>(c) / static_cast<double>(columns);
    for (std::size_t r = 0; r < rows; ++r) {
      const double elevation = model.vertical_fov * (0.5 - static_cast<double>(r) / static_cast<double>(rows - 1));
      const Eigen::Vector3d ray(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                                std::sin(elevation));
      const double range = scene.range(pose.translation(), pose.linear() * ray);
      if (model.times) sweep.seconds[r * columns + c] = static_cast<float>(fraction * model.period);
      if (range > 0.0) sweep.points[r * columns + c] = ((range + noise()) * ray).cast<float>();
    }
  }
  return sweep;
}

}  // namespace adit::lidar_odometry
