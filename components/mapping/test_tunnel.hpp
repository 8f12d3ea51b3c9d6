// For tests: a tunnel along a circle with features drawn by a seed, seen without rays: points of its wall.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include "components/mapping/cloud.hpp"

namespace adit::mapping {

struct TestTunnel {
  double lap = 240.0;      // m, of the circle's circumference
  double wall = 4.0;       // m, the tube's radius
  double depth = 0.2;      // m, of niches and cabinets
  double paint = 40.0;     // of the reflectivity, around 60
  double period = 0.0;     // m after which the features repeat; 0: a lap
  std::uint32_t seed = 1;  // of the features
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();

  double radius() const { return lap / (2.0 * std::numbers::pi); }

  // The middle of the tube, looking along it.
  Pose at(double s) const {
    const double angle = s / radius();
    Pose pose = Pose::Identity();
    pose.linear() = so3_exp({0.0, 0.0, angle});
    pose.translation() = origin + radius() * Eigen::Vector3d(std::sin(angle), 1.0 - std::cos(angle), 0.0);
    return pose;
  }

  // In [0, 1): of the piece of wall (2 m, 30 degrees) at (s, angle).
  double dice(double s, double angle, std::uint32_t salt) const {
    const double along = std::fmod(std::fmod(s, period > 0.0 ? period : lap) + lap, period > 0.0 ? period : lap);
    std::uint32_t h = seed * 2654435761U + salt * 40503U;
    for (const double v : {along / 2.0, angle / (std::numbers::pi / 6.0)}) {
      h ^= static_cast<std::uint32_t>(std::floor(v)) + 0x9e3779b9U + (h << 6U) + (h >> 2U);
      h *= 2246822519U;
      h ^= h >> 13U;
    }
    return static_cast<double>(h) / 4294967296.0;
  }

  // A sweep from a pose that is `s` along the tube: points within 30 m, 1 cm of noise, without times.
  Points seen_from(const Pose& pose, double s, std::size_t points, std::uint32_t noise_seed) const {
    std::mt19937 random(noise_seed);
    std::uniform_real_distribution<double> unit;
    std::normal_distribution<double> normal;
    Points out;
    const Pose back = pose.inverse();
    for (std::size_t i = 0; i < points; ++i) {
      const double along = s + 60.0 * (unit(random) - 0.5);
      const double angle = 2.0 * std::numbers::pi * unit(random);
      double r = wall + 0.01 * normal(random);
      const double kind = dice(along, angle, 1);
      if (kind < 0.12) r += depth;
      if (kind > 0.88) r -= depth;
      const double turn = along / radius();
      const Eigen::Vector3d middle = origin + radius() * Eigen::Vector3d(std::sin(turn), 1.0 - std::cos(turn), 0.0);
      const Eigen::Vector3d left(-std::sin(turn), std::cos(turn), 0.0);
      const Eigen::Vector3d on_wall =
          middle + r * (std::cos(angle) * left + std::sin(angle) * Eigen::Vector3d::UnitZ());
      const double reflectivity = 60.0 + paint * (dice(along, angle, 2) - 0.5);
      out.push_back({(back * on_wall).cast<float>(), static_cast<float>(reflectivity)});
    }
    return out;
  }
};

}  // namespace adit::mapping
