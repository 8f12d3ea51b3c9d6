// Large messages at sensor rates and small ones at full speed, with default settings, nothing lost.
#include <algorithm>
#include <cstdio>
#include <thread>

#include "tests/contract/contract.hpp"

namespace adit::contract {
namespace {

class Throughput : public Contract {};
INSTANTIATE_TEST_SUITE_P(Pairs, Throughput, testing::ValuesIn(all_pairs()), name_of);

struct Figures {
  std::uint64_t sent = 0;
  std::size_t received = 0;
  std::size_t damaged = 0;
  std::vector<double> latency_ms;  // sorted
  LinkStats reader;
};

double quantile(const std::vector<double>& sorted, double q) {
  return sorted.empty() ? 0.0 : sorted[static_cast<std::size_t>(q * static_cast<double>(sorted.size() - 1))];
}

// Publishes `count` samples of `size` bytes at `rate` per second and takes them on a thread of its own.
Figures run(Link& link, std::size_t size, unsigned count, double rate) {
  Figures figures;
  std::atomic<bool> done = false;
  std::thread taker([&] {
    Collector collector(*link.reader);
    while (figures.received < count) {
      const bool more = collector.wait_for(1, done ? 2000ms : 100ms);
      for (const Sample& sample : collector.samples) {
        const std::chrono::duration<double, std::milli> latency =
            sample.info().received_time - sample.info().source_time;
        figures.latency_ms.push_back(latency.count());
        ++figures.received;
        // Comparing all of 4 MB in each would make the reader the bottleneck that is tested.
        if (figures.received % 10 == 1 && !is_intact(sample.bytes(), size)) ++figures.damaged;
      }
      collector.samples.clear();
      if (!more && done) break;
    }
  });
  const auto period = std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(1.0 / rate));
  auto next = std::chrono::steady_clock::now();
  for (unsigned n = 1; n <= count; ++n) {
    std::this_thread::sleep_until(next);
    next += period;
    if (link.writer->publish(Payload(size, n))) ++figures.sent;
  }
  done = true;
  taker.join();
  std::sort(figures.latency_ms.begin(), figures.latency_ms.end());
  figures.reader = link.reader->stats();
  return figures;
}

void expect_nothing_lost(const Figures& figures, unsigned count, const std::string& what) {
  std::printf("%s: sent %llu, received %zu, lost %llu, overwritten %llu, p50 %.2f ms, p99 %.2f ms\n", what.c_str(),
              static_cast<unsigned long long>(figures.sent), figures.received,
              static_cast<unsigned long long>(figures.reader.lost),
              static_cast<unsigned long long>(figures.reader.overwritten), quantile(figures.latency_ms, 0.5),
              quantile(figures.latency_ms, 0.99));
  EXPECT_EQ(figures.sent, count);
  EXPECT_EQ(figures.received, count);
  EXPECT_EQ(figures.reader.lost, 0u);
  EXPECT_EQ(figures.damaged, 0u);
}

constexpr std::size_t cloud = 4u << 20;

TEST_P(Throughput, HundredCloudsOf4MegabytesBestEffort) {
  Link link(*this, GetParam(), Qos::sensor(), Qos::sensor());
  ASSERT_TRUE(link.reader && link.writer);
  expect_nothing_lost(run(link, cloud, 100, 20.0), 100, "4 MB at 20 Hz, best effort");
}

TEST_P(Throughput, HundredCloudsOf4MegabytesReliable) {
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  expect_nothing_lost(run(link, cloud, 100, 20.0), 100, "4 MB at 20 Hz, reliable");
}

TEST_P(Throughput, SmallMessagesAtFullSpeedKeepAllReliable) {
  Qos keep_all = Qos::reliable(0);
  keep_all.max_blocking = 10s;
  Link link(*this, GetParam(), keep_all, keep_all);
  ASSERT_TRUE(link.reader && link.writer);
  constexpr unsigned count = 20000;
  const auto start = std::chrono::steady_clock::now();
  const Figures figures = run(link, 1024, count, 1e9);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  expect_nothing_lost(figures, count, "1 KB at full speed, reliable, keep all");
  std::printf("  %.0f messages per second\n", count / took.count());
}

}  // namespace
}  // namespace adit::contract
