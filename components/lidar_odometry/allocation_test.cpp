// After warm-up a sweep costs no heap call. Counts every call of the C++ heap in this program.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdlib>
#include <new>

#include "components/lidar_odometry/lidar_odometry.hpp"
#include "components/lidar_odometry/test_scene.hpp"

namespace {
std::atomic<std::uint64_t> heap_calls{0};
}

void* operator new(std::size_t size) {
  ++heap_calls;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  ++heap_calls;
  const auto align = static_cast<std::size_t>(alignment);
  if (void* memory = std::aligned_alloc(align, (size + align - 1) / align * align)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}

namespace adit::lidar_odometry {
namespace {

TEST(Allocation, ASweepCostsNoHeapCallAfterWarmUp) {
  // Back and forth in a hall, organised and not: new cells, removed cells, prior and none.
  std::vector<RecordedSweep> sweeps;
  Pose pose = Pose::Identity();
  for (int k = 0; k < 40; ++k) {
    Vector6d twist = Vector6d::Zero();
    twist[0] = 2.0 * std::sin(0.3 * k);
    twist[5] = 0.3 * std::cos(0.2 * k);
    pose = pose * se3_exp(0.1 * twist);
    sweeps.push_back(scan(hall(), {}, pose, twist, 0, static_cast<unsigned>(k)));
    if (k % 2 == 1) sweeps.back().height = 1;
  }
  for (const Mode mode : {Mode::kiss, Mode::genz, Mode::default_}) {
    for (const int threads : {1, 2}) {
      Config config;
      config.mode = mode;
      config.threads = threads;
      LidarOdometry odometry(config);
      std::int64_t stamp = 0;
      std::uint64_t before = 0;
      // The first two rounds warm up; in the third every sweep is counted.
      for (int round = 0; round < 3; ++round) {
        if (round == 2) before = heap_calls;
        for (std::size_t k = 0; k < sweeps.size(); ++k) {
          Cloud cloud = sweeps[k].cloud();
          cloud.stamp_ns = stamp += 100'000'000;
          const Prior prior;
          odometry.process(cloud, k % 4 == 0 ? &prior : nullptr);
        }
      }
      EXPECT_EQ(heap_calls - before, 0u) << to_string(mode) << ", " << threads << " threads";
    }
  }
}

}  // namespace
}  // namespace adit::lidar_odometry
