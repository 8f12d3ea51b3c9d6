// Counts every malloc of the program while armed: the data path must not allocate once it is warm.
#include <gtest/gtest.h>

#include <cstdlib>

#include "components/thermal_odometry/test_scene.hpp"
#include "components/thermal_odometry/thermal_odometry.hpp"

namespace {
bool armed = false;
long allocations = 0;
}  // namespace

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) {
  if (armed) ++allocations;
  return __libc_malloc(size);
}
#endif

namespace adit::thermal_odometry {
namespace {

void drive(Mode mode, int frames, int warm, int lidar_to) {
  TestScene scene;
  Config config;
  config.mode = mode;
  auto odometry = ThermalOdometry::create(scene.camera, config);
  ASSERT_TRUE(odometry);
  allocations = 0;
  int keyframes = 0;
  for (int i = 0; i < frames; ++i) {
    const Pose pose = TestScene::drive(0.04 * i, 3.0);
    const Frame frame = scene.render(pose, i * 40'000'000LL);
    const bool scan = i % 3 == 0 && i < lidar_to;
    const DepthPoints cloud = scan ? scene.scan(pose, i * 40'000'000LL) : DepthPoints{};
    armed = i >= warm;
    const Estimate& estimate = (*odometry)->process(frame, nullptr, scan ? &cloud : nullptr);
    armed = false;
    keyframes += i >= warm && estimate.new_keyframe ? 1 : 0;
  }
  EXPECT_GT(keyframes, 3);
  EXPECT_EQ(allocations, 0);
}

TEST(Allocation, NoneAnchoredAndInAnOutage) {
  drive(Mode::anchored, 80, 30, 50);
}
TEST(Allocation, NoneMonocular) {
  drive(Mode::mono, 60, 30, 0);
}

}  // namespace
}  // namespace adit::thermal_odometry
