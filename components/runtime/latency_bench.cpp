// Same-process latency: publish() to handler, by size, beside a bare condition-variable wake-up in the same run.
//   adit_runtime_latency [rounds]
#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <semaphore>
#include <thread>
#include <vector>

#include "components/runtime/component.hpp"
#include "components/runtime/testing/harness.hpp"
#include "sensor_msgs/msg/image.hpp"

namespace {

using namespace adit;
using Steady = std::chrono::steady_clock;
using sensor_msgs::msg::Image;

struct Figures {
  double p50, p90;  // us
};

Figures figures(std::vector<double>& us) {
  std::sort(us.begin(), us.end());
  return {us[us.size() / 2], us[us.size() * 9 / 10]};
}

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

}  // namespace

int main(int argc, char** argv) {
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 500;
  const std::vector<std::size_t> sizes = {64, 1'000, 64'000, 1'000'000, 4'000'000};
  testing::Harness harness(1);
  auto& source = harness.make<Source>("source");
  auto& sink = harness.make<Sink>("sink");
  harness.start();
  BareWakeUp bare;
  std::vector<double> bare_us;
  std::vector<std::vector<double>> us(sizes.size());
  // Interleaved, so that what else runs on the machine meets all alike; paced, so that threads are asleep.
  for (int i = -20; i < rounds; ++i) {
    std::this_thread::sleep_for(std::chrono::microseconds(500));
    const double bare_round = bare.round();
    if (i >= 0) bare_us.push_back(bare_round);
    for (std::size_t s = 0; s < sizes.size(); ++s) {
      Loan<Image> loan = source.image.loan();
      loan->data.resize(sizes[s]);
      std::this_thread::sleep_for(std::chrono::microseconds(500));
      const auto start = Steady::now();
      source.image.publish(std::move(loan));
      sink.done.acquire();
      if (i >= 0) us[s].push_back(std::chrono::duration<double, std::micro>(sink.woken - start).count());
    }
  }
  const Figures reference = figures(bare_us);
  std::printf("%-28s p50 %7.2f us  p90 %7.2f us\n", "bare condition variable", reference.p50, reference.p90);
  for (std::size_t s = 0; s < sizes.size(); ++s) {
    const Figures f = figures(us[s]);
    std::printf("publish to handler %9zu B p50 %7.2f us  p90 %7.2f us  p50 over bare %+.2f us\n", sizes[s], f.p50,
                f.p90, f.p50 - reference.p50);
  }
}
