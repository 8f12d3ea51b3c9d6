// Same-process latency: publish() to handler, by size, beside a bare condition-variable wake-up in the same run.
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <semaphore>
#include <thread>

#include "components/runtime/component.hpp"
#include "components/runtime/testing/harness.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "tests/benchmarks/bench.hpp"

namespace adit::bench {
namespace {

using Steady = std::chrono::steady_clock;
using sensor_msgs::msg::Image;

// One thread sleeps on a condition variable, another wakes it: what no delivery between threads can undercut.
class BareWakeUp {
 public:
  BareWakeUp() : thread_([this] { wait(); }) {}
  ~BareWakeUp() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
  }
  double round() {
    const auto start = Steady::now();
    {
      const std::lock_guard lock(mutex_);
      ready_ = true;
    }
    wake_.notify_one();
    done_.acquire();
    return std::chrono::duration<double, std::micro>(woken_ - start).count();
  }

 private:
  void wait() {
    std::unique_lock lock(mutex_);
    while (true) {
      wake_.wait(lock, [this] { return ready_ || stop_; });
      if (stop_) return;
      woken_ = Steady::now();
      ready_ = false;
      done_.release();
    }
  }
  std::mutex mutex_;
  std::condition_variable wake_;
  bool ready_ = false;
  bool stop_ = false;
  Steady::time_point woken_;
  std::binary_semaphore done_{0};
  std::jthread thread_;
};

struct Source final : Component {
  Output<Image> image{*this, "image", Qos::sensor()};
};

struct Sink final : Component {
  Steady::time_point woken;
  std::binary_semaphore done{0};
  Input<Image> image{*this, "image", Qos::sensor(), Queue{2}, [this](const Image&, const MessageInfo&) {
                       woken = Steady::now();
                       done.release();
                     }};
};

struct Figures {
  std::vector<double> bare_us;
  std::array<std::vector<double>, sizes.size()> us;
};

// Interleaved, so that what else runs on the machine meets all alike; paced, so that threads are asleep.
Figures measure() {
  const int rounds = settings().quick ? 10 : 500;
  const int warm_up = settings().quick ? 5 : 20;
  testing::Harness harness(1);
  auto& source = harness.make<Source>("source");
  auto& sink = harness.make<Sink>("sink");
  harness.start();
  BareWakeUp bare;
  Figures figures;
  for (int i = -warm_up; i < rounds; ++i) {
    std::this_thread::sleep_for(std::chrono::microseconds(500));
    const double bare_round = bare.round();
    if (i >= 0) figures.bare_us.push_back(bare_round);
    for (std::size_t turn = 0; turn < sizes.size(); ++turn) {
      // Each size comes first as often as the others: the first one after the bare round meets a cold cache.
      const std::size_t s = (turn + static_cast<std::size_t>(i + warm_up)) % sizes.size();
      Loan<Image> loan = source.image.loan();
      loan->data.resize(sizes[s]);
      std::this_thread::sleep_for(std::chrono::microseconds(500));
      const auto start = Steady::now();
      source.image.publish(std::move(loan));
      sink.done.acquire();
      if (i >= 0) figures.us[s].push_back(std::chrono::duration<double, std::micro>(sink.woken - start).count());
    }
  }
  double lowest = 1e9, highest = 0;
  const double bare_p50 = quantile(figures.bare_us, 0.5);
  print_later("\nSame process, publish() to handler      p50 us   p90 us   p50 over bare us\n");
  print_later("%-38s %7.2f  %7.2f\n", "bare condition-variable wake-up", bare_p50, quantile(figures.bare_us, 0.9));
  for (std::size_t s = 0; s < sizes.size(); ++s) {
    const double p50 = quantile(figures.us[s], 0.5);
    lowest = std::min(lowest, p50);
    highest = std::max(highest, p50);
    print_later("%-38s %7.2f  %7.2f  %+7.2f\n", size_name(sizes[s]).c_str(), p50, quantile(figures.us[s], 0.9),
                p50 - bare_p50);
  }
  print_later("slowest size / fastest size %.2f (goal <= 1.2; over bare <= 5 us)\n", highest / lowest);
  return figures;
}

void report(benchmark::State& state, const std::vector<double>& us) {
  for (auto _ : state) state.SetIterationTime(quantile(us, 0.5) * 1e-6);
  state.counters["p90_us"] = quantile(us, 0.9);
  state.counters["messages"] = static_cast<double>(us.size());
}

const Figures& figures() {
  static const Figures measured = measure();
  return measured;
}

}  // namespace

void register_same_process() {
  const auto add = [](const std::string& name, auto select) {
    benchmark::RegisterBenchmark(("same_process/" + name).c_str(),
                                 [select](benchmark::State& state) { report(state, select()); })
        ->UseManualTime()
        ->Iterations(1)
        ->Unit(benchmark::kMicrosecond);
  };
  add("bare_wake_up", []() -> const std::vector<double>& { return figures().bare_us; });
  for (std::size_t s = 0; s < sizes.size(); ++s) {
    add(std::to_string(sizes[s]), [s]() -> const std::vector<double>& { return figures().us[s]; });
  }
}

}  // namespace adit::bench
