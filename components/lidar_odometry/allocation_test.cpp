// After warm-up a sweep costs no heap call. Counts every allocation in this program.
#include <gtest/gtest.h>

#include <cmath>

#include "components/lidar_odometry/lidar_odometry.hpp"
#include "components/lidar_odometry/test_scene.hpp"
#include "idl/testing/allocation_counter.hpp"

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
        if (round == 2) before = adit::test::allocations();
        for (std::size_t k = 0; k < sweeps.size(); ++k) {
          Cloud cloud = sweeps[k].cloud();
          cloud.stamp_ns = stamp += 100'000'000;
          Prior prior;
          const StampedPose within[2] = {{cloud.stamp_ns, Pose::Identity()},
                                         {cloud.stamp_ns + 100'000'000, Pose::Identity()}};
          if (k % 8 == 0) prior.sweep = within;
          odometry.process(cloud, k % 4 == 0 ? &prior : nullptr);
        }
      }
      EXPECT_EQ(adit::test::allocations() - before, 0u) << to_string(mode) << ", " << threads << " threads";
    }
  }
}

}  // namespace
}  // namespace adit::lidar_odometry
