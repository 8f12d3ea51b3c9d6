// A corridor with textured walls, its thermal image and its LiDAR cloud from any pose: exact truth for the tests.
// World axes are those of the first camera: x right, y down, z forward along the corridor.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "components/thermal_odometry/frame.hpp"

namespace adit::thermal_odometry {

class TestScene {
 public:
  CameraModel camera{320, 256, 210.0, 210.0, 159.5, 127.5, Distortion::none, {}};
  double contrast = 1.0;  // 1: about +-100 counts of texture, i.e. +-2 K
  double noise = 2.5;     // counts
  double offset = 0.0;    // counts, everywhere
  double gain = 1.0;
  std::vector<float> fixed_pattern;  // counts a pixel; empty: none
  double repeats_every = 0.0;        // m along the corridor, even: the same walls again; 0: never

  explicit TestScene(std::uint32_t seed = 1) : random_(seed) {
    std::normal_distribution<float> normal;
    noise_table_.resize(1U << 16U);
    for (float& value : noise_table_) value = normal(random_);
  }

  void new_fixed_pattern(float sigma) {
    fixed_pattern.resize(static_cast<std::size_t>(camera.width * camera.height));
    std::normal_distribution<float> normal(0.0F, sigma);
    for (float& value : fixed_pattern) value = normal(random_);
  }

  // A camera pose on a smooth drive along the corridor: forward speed and gentle sway [m, rad].
  static Pose drive(double t, double speed) {
    Pose T = Pose::Identity();
    T.translation() = Eigen::Vector3d(0.25 * std::sin(0.9 * t), 0.04 * std::sin(2.1 * t), speed * t);
    T.linear() =
        so3_exp(Eigen::Vector3d(0.006 * std::sin(1.7 * t), 0.05 * std::sin(0.7 * t), 0.01 * std::sin(1.1 * t)));
    return T;
  }

  Frame render(const Pose& T_world_camera, std::int64_t stamp_ns) {
    pixels_.resize(static_cast<std::size_t>(camera.width * camera.height));
    const Eigen::Matrix3d R = T_world_camera.rotation();
    const auto shift = static_cast<std::size_t>(random_());
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; ++u) {
        const Eigen::Vector3d ray = R * Eigen::Vector3d((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0);
        const Hit hit = cast(T_world_camera.translation(), ray);
        const auto i = static_cast<std::size_t>(v * camera.width + u);
        double value = 6000.0 + offset + gain * contrast * radiance(hit);
        value += noise * noise_table_[(i * 7919 + shift + i / 61) & 0xFFFFU];
        if (!fixed_pattern.empty()) value += fixed_pattern[i];
        pixels_[i] = static_cast<std::uint16_t>(std::clamp(value + 0.5, 0.0, 65535.0));
      }
    }
    return {pixels_.data(), camera.width, camera.height, 0, stamp_ns, FfcState::unknown};
  }

  // 48 rings over +-25 degrees, 512 columns over the front half circle, 1 cm noise; a sensor with x forward, z up that
  // sits `lever` beside the camera.
  DepthPoints scan(const Pose& T_world_camera, std::int64_t stamp_ns) {
    cloud_.clear();
    const Pose T_camera_sensor = extrinsics();
    const Pose T_world_sensor = T_world_camera * T_camera_sensor;
    for (int ring = 0; ring < 48; ++ring) {
      const double elevation = (ring - 23.5) / 47.0 * 50.0 * M_PI / 180.0;
      for (int column = 0; column < 512; ++column) {
        const double azimuth = (column - 255.5) / 511.0 * M_PI;
        const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                                        std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
        const Hit hit = cast(T_world_sensor.translation(), T_world_sensor.rotation() * direction);
        if (hit.distance > 60.0) continue;
        const double range = hit.distance + 0.01 * noise_table_[random_() & 0xFFFFU];
        cloud_.emplace_back((range * direction).cast<float>());
      }
    }
    return {cloud_, {}, stamp_ns, T_camera_sensor};
  }

  static Pose extrinsics() {
    Pose T = Pose::Identity();
    T.linear() << 0, -1, 0, 0, 0, -1, 1, 0, 0;  // sensor x forward, y left, z up to camera right, down, forward
    T.translation() = Eigen::Vector3d(0.1, -0.15, -0.05);
    return T;
  }

  // Depth along the optical axis of the pixel, exact.
  double depth(const Pose& T_world_camera, double u, double v) const {
    const Eigen::Vector3d ray((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0);
    return cast(T_world_camera.translation(), T_world_camera.rotation() * ray).distance;
  }

 private:
  struct Hit {
    double distance = 1e9;  // in units of the ray's length
    int wall = 0;
    double across = 0.0;  // position on the wall [m]
    double along = 0.0;
    double clearance = 1.0;  // distance from the origin to the wall's plane
  };

  static Hit cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) {
    Hit best;
    const auto try_wall = [&](int wall, double clearance, double speed) {
      if (speed <= 1e-9 || clearance / speed >= best.distance) return;
      best.distance = clearance / speed;
      best.wall = wall;
      best.clearance = clearance;
    };
    try_wall(0, 3.0 - origin.x(), ray.x());
    try_wall(1, 3.0 + origin.x(), -ray.x());
    try_wall(2, 2.0 - origin.y(), ray.y());
    try_wall(3, 2.5 + origin.y(), -ray.y());
    const Eigen::Vector3d point = origin + best.distance * ray;
    best.along = point.z();
    best.across = best.wall < 2 ? point.y() : point.x();
    return best;
  }

  static int wrap(int i, int period) { return period > 0 ? (i % period + period) % period : i; }

  static double hash(int wall, int octave, int i, int j) {
    auto h = static_cast<std::uint32_t>(i) * 374761393U + static_cast<std::uint32_t>(j) * 668265263U +
             static_cast<std::uint32_t>(wall * 97 + octave) * 2246822519U;
    h = (h ^ (h >> 13U)) * 1274126177U;
    return static_cast<double>((h ^ (h >> 16U)) & 0xFFFFU) / 32767.5 - 1.0;
  }

  double radiance(const Hit& hit) const {
    const double z = std::min(hit.distance, 200.0);
    const double footprint = std::max(z, z * z / std::max(0.3, hit.clearance)) / camera.fx;
    double sum = 0.0;
    double wavelength = 2.0;
    double amplitude = 60.0;
    for (int octave = 0; octave < 4; ++octave, wavelength *= 0.5, amplitude *= 0.8) {
      const double fade = std::clamp(wavelength / (2.0 * footprint) - 0.5, 0.0, 1.0);
      if (fade == 0.0) break;
      const double x = hit.along / wavelength;
      const double y = hit.across / wavelength;
      const int period = static_cast<int>(std::lround(repeats_every / wavelength));
      const int at = static_cast<int>(std::floor(x));
      const int i = wrap(at, period);
      const int next = wrap(at + 1, period);
      const int j = static_cast<int>(std::floor(y));
      const auto ease = [](double s) { return s * s * (3.0 - 2.0 * s); };
      const double fx = ease(x - at);
      const double fy = ease(y - j);
      const double near = hash(hit.wall, octave, i, j) * (1 - fx) + hash(hit.wall, octave, next, j) * fx;
      const double far = hash(hit.wall, octave, i, j + 1) * (1 - fx) + hash(hit.wall, octave, next, j + 1) * fx;
      sum += fade * amplitude * (near * (1 - fy) + far * fy);
    }
    return sum;
  }

  std::mt19937 random_;
  std::vector<float> noise_table_;
  std::vector<std::uint16_t> pixels_;
  std::vector<Eigen::Vector3f> cloud_;
};

}  // namespace adit::thermal_odometry
