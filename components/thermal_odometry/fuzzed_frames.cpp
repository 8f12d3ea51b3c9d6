#include "components/thermal_odometry/fuzzed_frames.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "components/thermal_odometry/test_scene.hpp"
#include "components/thermal_odometry/thermal_odometry.hpp"

namespace adit::thermal_odometry {

// Noise, black, saturated, duplicated, reordered, blocks, random prior and cloud: a finite answer to each.
void survive_fuzzed_frames(int frames, std::uint32_t seed) {
  TestScene scene;
  auto odometry = ThermalOdometry::create(scene.camera, {});
  ASSERT_TRUE(odometry);
  std::mt19937 random(seed);
  std::vector<std::uint16_t> pixels(320 * 256);
  std::int64_t stamp = 0;
  int measured = 0;
  for (int i = 0; i < frames; ++i) {
    stamp += static_cast<std::int64_t>(random() % 90'000'000) - 5'000'000;
    Frame frame = scene.render(TestScene::drive(0.02 * i, 4.0), stamp);
    std::copy(frame.data, frame.data + pixels.size(), pixels.begin());
    frame.data = pixels.data();
    const auto kind = random() % 12;
    for (std::size_t k = 0; k < pixels.size(); ++k) {
      if (kind == 0) pixels[k] = static_cast<std::uint16_t>(random());
      if (kind == 1) pixels[k] = 0;
      if (kind == 2) pixels[k] = 65535;
      if (kind == 3 && (k / 3200 + k % 320 / 32) % 2 == 0) pixels[k] = static_cast<std::uint16_t>(random() % 2 * 65535);
      if (kind == 4) pixels[k] = static_cast<std::uint16_t>(65535 - pixels[k]);
    }
    if (kind == 5) frame.height = 100;
    if (kind == 6) frame.data = nullptr;
    Prior prior;
    prior.T_previous_current.translation().setConstant(kind == 7 ? std::nan("") : (kind == 8 ? 1e6 : 0.01));
    prior.covariance *= kind == 9 ? -1.0 : 0.01;
    DepthPoints cloud = scene.scan(TestScene::drive(0.02 * i, 4.0), stamp);
    std::vector<Eigen::Vector3f> points(cloud.points.begin(), cloud.points.end());
    if (kind == 10) {
      for (auto& point : points) point *= static_cast<float>(random() % 100) - 50.0F;
    }
    if (kind == 11) points.assign(100, Eigen::Vector3f::Constant(std::nanf("")));
    cloud.points = points;
    const Estimate& estimate =
        (*odometry)->process(frame, random() % 2 ? &prior : nullptr, random() % 3 ? &cloud : nullptr);
    ASSERT_TRUE(estimate.T_odom_camera.matrix().allFinite()) << i;
    ASSERT_TRUE(estimate.covariance.allFinite()) << i;
    ASSERT_TRUE(std::isfinite(estimate.residual)) << i;
    measured += estimate.measured ? 1 : 0;
  }
  EXPECT_GT(measured, frames / 20);
}

}  // namespace adit::thermal_odometry
