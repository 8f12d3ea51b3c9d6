#include "components/tunnel_simulator/pixel_lag.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace adit::tunnel_simulator {
namespace {

// Against the response itself: what a pixel shows is the mean over exp(-s / time_constant) of what it saw s ago, here
// of an image that grows by 1 a column or a row, so that the mean is that of places.
class Lag : public testing::Test {
 protected:
  Lag() : camera_(CameraModel::from_hfov(320, 256, 75.0 * std::numbers::pi / 180.0)) {
    for (int y = 0; y < camera_.height; ++y) {
      for (int x = 0; x < camera_.width; ++x) {
        const Eigen::Vector3d ray = camera_.ray({x, y});
        plane_x_.push_back(static_cast<float>(ray.x() / ray.z()));
        plane_y_.push_back(static_cast<float>(ray.y() / ray.z()));
        ray_z_.push_back(static_cast<float>(ray.z()));
        columns_.push_back(static_cast<float>(x));
        rows_.push_back(static_cast<float>(y));
        range_.push_back(static_cast<float>(depth / ray.z()));
      }
    }
  }
  using Motion = std::function<Pose(double)>;
  static constexpr double tau = 0.010, row_time = 32e-6, depth = 8.0;

  // Where, on average, the pixel's past views of a wall at `depth` are now.
  Eigen::Vector2d expected(const Motion& pose, double time, int x, int y) const {
    const double now = time + row_time * y;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    constexpr int steps = 400;
    for (int k = 0; k < steps; ++k) {
      const double age = -tau * std::log1p(-(k + 0.5) / steps);
      const Eigen::Vector3d ray = camera_.ray({x, y});
      sum += camera_.project(pose(now).inverse() * (pose(now - age) * Eigen::Vector3d(depth / ray.z() * ray)));
    }
    return sum / steps;
  }
  // Largest difference at some pixels, and the largest displacement there [px].
  std::pair<double, double> worst(const Motion& pose, double time) {
    PixelLag lag(camera_, tau, row_time);
    lag.begin(pose, time);
    std::vector<float> by_column(columns_.size()), by_row(columns_.size());
    double off = 0.0, moved = 0.0;
    for (const int y : {60, 128, 200}) {
      lag.apply(y, {plane_x_, plane_y_, ray_z_}, range_, columns_, by_column);
      lag.apply(y, {plane_x_, plane_y_, ray_z_}, range_, rows_, by_row);
      for (const int x : {60, 110, 160, 260}) {
        const auto i = static_cast<std::size_t>(y * camera_.width + x);
        const Eigen::Vector2d wanted = expected(pose, time, x, y);
        off = std::max(off, (Eigen::Vector2d(by_column[i], by_row[i]) - wanted).norm());
        moved = std::max(moved, (Eigen::Vector2d(x, y) - wanted).norm());
      }
    }
    return {off, moved};
  }

  CameraModel camera_;
  std::vector<float> plane_x_, plane_y_, ray_z_, columns_, rows_, range_;
};

TEST_F(Lag, IsOneTimeConstantHoweverShortTheTrail) {
  for (const double rate : {0.01, 0.05, 0.1, 0.2, 0.5, 1.0, 3.0}) {
    const auto turning = [&](double t) { return Pose(Eigen::AngleAxisd(rate * t, Eigen::Vector3d::UnitY())); };
    const auto [off, moved] = worst(turning, 1.0);
    EXPECT_LT(off, 0.02 * moved + 1e-3) << rate << " rad/s";
  }
  for (const double speed : {0.5, 3.0, 14.0}) {
    const auto driving = [&](double t) { return Pose(Eigen::Translation3d(0.0, 0.0, speed * t)); };
    const auto [off, moved] = worst(driving, 1.0);
    EXPECT_LT(off, 0.02 * moved + 1e-3) << speed << " m/s";
  }
}

TEST_F(Lag, FollowsATrot) {
  // 1.7 degrees at 5.6 Hz, at eight phases: the rate changes by a third within a time constant.
  const auto nodding = [](double t) {
    return Pose(Eigen::AngleAxisd(0.03 * std::sin(2.0 * std::numbers::pi * 5.6 * t), Eigen::Vector3d::UnitX()));
  };
  for (int phase = 0; phase < 8; ++phase) {
    EXPECT_LT(worst(nodding, 1.0 + phase / (8 * 5.6)).first, 0.05) << phase;
  }
}

TEST_F(Lag, IsNoneWhenNothingMoves) {
  EXPECT_EQ(worst([](double) { return Pose::Identity(); }, 1.0).first, 0.0);
}

}  // namespace
}  // namespace adit::tunnel_simulator
