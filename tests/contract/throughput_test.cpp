// Large messages at sensor rates and small ones at full speed, with default settings, nothing lost.
#include <cstdio>

#include "tests/contract/load.hpp"

namespace adit::contract {
namespace {

class Throughput : public Contract {};
INSTANTIATE_TEST_SUITE_P(Pairs, Throughput, testing::ValuesIn(all_pairs()), name_of);

TEST_P(Throughput, HundredCloudsOf4MegabytesBestEffort) {
  Link link(*this, GetParam(), Qos::sensor(), Qos::sensor());
  ASSERT_TRUE(link.reader && link.writer);
  expect_nothing_lost(run_load(link, cloud, 100, 20.0), 100, "4 MB at 20 Hz, best effort");
}

TEST_P(Throughput, HundredCloudsOf4MegabytesReliable) {
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  expect_nothing_lost(run_load(link, cloud, 100, 20.0), 100, "4 MB at 20 Hz, reliable");
}

TEST_P(Throughput, SmallMessagesAtFullSpeedKeepAllReliable) {
  Qos keep_all = Qos::reliable(0);
  keep_all.max_blocking = 10s;
  Link link(*this, GetParam(), keep_all, keep_all);
  ASSERT_TRUE(link.reader && link.writer);
  constexpr unsigned count = 20000;
  const auto start = std::chrono::steady_clock::now();
  const LoadFigures figures = run_load(link, 1024, count, 1e9);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  expect_nothing_lost(figures, count, "1 KB at full speed, reliable, keep all");
  std::printf("  %.0f messages per second\n", count / took.count());
}

}  // namespace
}  // namespace adit::contract
