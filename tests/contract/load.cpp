#include "tests/contract/load.hpp"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <thread>

namespace adit::contract {
namespace {

double quantile(const std::vector<double>& sorted, double q) {
  return sorted.empty() ? 0.0 : sorted[static_cast<std::size_t>(q * static_cast<double>(sorted.size() - 1))];
}

}  // namespace

LoadFigures run_load(Link& link, std::size_t size, unsigned count, double rate) {
  LoadFigures figures;
  std::atomic<bool> done = false;
  std::thread taker([&] {
    Collector collector(*link.reader);
    while (figures.received < count) {
      const bool all_sent = done;  // before the wait: one that began earlier is too short to be the last
      const bool more = collector.wait_for(1, all_sent ? 2000ms : 100ms);
      for (const Sample& sample : collector.samples) {
        const std::chrono::duration<double, std::milli> latency =
            sample.info().received_time - sample.info().source_time;
        figures.latency_ms.push_back(latency.count());
        ++figures.received;
        // Comparing all of 4 MB in each would make the reader the bottleneck that is tested.
        if (figures.received % 10 == 1 && !is_intact(sample.bytes(), size)) ++figures.damaged;
      }
      collector.samples.clear();
      if (!more && all_sent) break;
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

void expect_nothing_lost(const LoadFigures& figures, unsigned count, const std::string& what) {
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

}  // namespace adit::contract
