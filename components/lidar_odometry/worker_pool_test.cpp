#include "components/lidar_odometry/worker_pool.hpp"

#include <gtest/gtest.h>

#include <atomic>

namespace adit::lidar_odometry {
namespace {

TEST(WorkerPool, RunsEachChunkOnceForAnyThreadCount) {
  for (int threads : {1, 2, 4}) {
    WorkerPool pool(threads);
    for (std::size_t chunks : {0u, 1u, 2u, 7u, 1000u}) {
      std::vector<std::atomic<int>> runs(chunks);
      pool.run(chunks, [&](std::size_t i) { ++runs[i]; });
      for (const auto& count : runs) ASSERT_EQ(count, 1);
    }
  }
}

TEST(WorkerPool, SeesTheResultsOfItsThreadsRunAfterRun) {
  WorkerPool pool(3);
  std::vector<long> values(64, 0);
  for (int round = 0; round < 2000; ++round) pool.run(values.size(), [&](std::size_t i) { values[i] += 1; });
  for (long value : values) ASSERT_EQ(value, 2000);
}

}  // namespace
}  // namespace adit::lidar_odometry
