// Counts every allocation of the program: the data path must not allocate once it is warm.
#include <gtest/gtest.h>

#include "components/thermal_odometry/test_scene.hpp"
#include "components/thermal_odometry/thermal_odometry.hpp"
#include "idl/testing/allocation_counter.hpp"

namespace adit::thermal_odometry {
namespace {

void drive(Mode mode, int frames, int warm, int lidar_to) {
  TestScene scene;
  Config config;
  config.mode = mode;
  auto odometry = ThermalOdometry::create(scene.camera, config);
  ASSERT_TRUE(odometry);
  std::uint64_t allocated = 0;
  int keyframes = 0;
  for (int i = 0; i < frames; ++i) {
    const Pose pose = TestScene::drive(0.04 * i, 3.0);
    const Frame frame = scene.render(pose, i * 40'000'000LL);
    const bool scan = i % 3 == 0 && i < lidar_to;
    const DepthPoints cloud = scan ? scene.scan(pose, i * 40'000'000LL) : DepthPoints{};
    const std::uint64_t before = adit::test::allocations();
    const Estimate& estimate = (*odometry)->process(frame, nullptr, scan ? &cloud : nullptr);
    if (i >= warm) allocated += adit::test::allocations() - before;
    keyframes += i >= warm && estimate.new_keyframe ? 1 : 0;
  }
  EXPECT_GT(keyframes, 3);
  EXPECT_EQ(allocated, 0u);
}

TEST(Allocation, NoneAnchoredAndInAnOutage) {
  drive(Mode::anchored, 80, 30, 50);
}
TEST(Allocation, NoneMonocular) {
  drive(Mode::mono, 60, 30, 0);
}

}  // namespace
}  // namespace adit::thermal_odometry
