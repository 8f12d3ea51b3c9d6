// adit_jitter: how late a 100 Hz timer of a component is, and how long 1 KB takes to another process's component and
// back, with the executor settings of a deployment. What a board is measured with, idle and under load:
//   adit_jitter [--seconds S] [--priority P] [--cpus 2,3] [--lock] [--load N] [--middleware fastdds|cyclonedds]
//   [--json]
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <memory>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>

#include "components/runtime/component.hpp"
#include "components/runtime/process.hpp"
#include "sensor_msgs/msg/image.hpp"

namespace adit {
namespace {

using sensor_msgs::msg::Image;
using Steady = std::chrono::steady_clock;
using Microseconds = std::chrono::duration<double, std::micro>;

constexpr auto period = std::chrono::milliseconds(10);
constexpr std::size_t payload = 1024;

// What the probe has seen; outlives it.
struct Results {
  std::vector<double> lateness;    // [us]
  std::vector<double> round_trip;  // [us]
  std::uint64_t missed = 0;
  std::uint64_t sent = 0;
};
Results results;

// Sends at each tick of its timer and takes the time until the message is back.
class Probe final : public Component {
  void tick(const TimerTick& tick) {
    results.missed += tick.missed;
    results.lateness.push_back(Microseconds(tick.now - tick.scheduled).count());
    Loan<Image> image = out_.loan();
    image->data.resize(payload);
    image->step = static_cast<std::uint32_t>(++results.sent);
    sent_at_ = Steady::now();
    out_.publish(std::move(image));
  }
  void back(const Image& image) {
    if (image.step != results.sent) return;
    results.round_trip.push_back(Microseconds(Steady::now() - sent_at_).count());
  }

  Steady::time_point sent_at_;
  Output<Image> out_{*this, "out", Qos::reliable(1)};
  Input<Image> in_{*this, "in", Qos::reliable(1), Queue{2, WhenFull::drop_oldest},
                   [this](const Image& image, const MessageInfo&) { back(image); }};
  Timer timer_{*this, "tick", period, [this](const TimerTick& at) { tick(at); }};
};
ADIT_COMPONENT(Probe, "adit_jitter_probe");

class Echo final : public Component {
  Output<Image> out_{*this, "in", Qos::reliable(1)};
  Input<Image> in_{*this, "out", Qos::reliable(1), Queue{2, WhenFull::drop_oldest},
                   [this](const Image& image, const MessageInfo&) {
                     Loan<Image> answer = out_.loan();
                     answer->step = image.step;
                     answer->data.resize(image.data.size());
                     out_.publish(std::move(answer));
                   }};
};
ADIT_COMPONENT(Echo, "adit_jitter_echo");

struct Settings {
  double seconds = 20.0;
  int load = 0;
  bool json = false;
  std::string vendor;
  std::uint32_t domain = 187;
  ExecutorConfig executor;
};

Result<void> serve(const Settings& settings, const std::string& type, std::stop_token stop) {
  ProcessConfig config;
  config.name = type;
  config.middleware.vendor = settings.vendor;
  config.middleware.domain = settings.domain;
  config.executor = settings.executor;
  config.log_level = LogLevel::warn;
  ComponentConfig component;
  component.type = type;
  component.name = type;
  config.components = {component};
  Result<std::unique_ptr<Process>> process = Process::build(config);
  if (!process) return process.error();
  if (Result<void> opened = (*process)->open(); !opened) return opened;
  if (Result<void> started = (*process)->start(); !started) return started;
  (*process)->run(stop);
  (*process)->shutdown();
  return {};
}

// Every other process of the machine that wants its processors, at normal priority.
void burn(std::stop_token stop) {
  std::vector<char> block(8u << 20);
  unsigned x = 1;
  static std::atomic<char> sink;
  while (!stop.stop_requested()) {
    for (std::size_t i = 0; i < block.size(); i += 64) block[i] = static_cast<char>(x = 1664525 * x + 1013904223);
    sink.store(block[x % block.size()], std::memory_order_relaxed);
  }
}

void print(const char* name, std::vector<double> values, bool json) {
  if (values.empty()) values.push_back(-1.0);
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {
    return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
  };
  const char* const form =
      json ? "\"%s\": {\"samples\": %zu, \"p50_us\": %.1f, \"p99_us\": %.1f, \"p999_us\": %.1f, \"max_us\": %.1f}"
           : "%-16s %7zu samples  p50 %8.1f  p99 %8.1f  p99.9 %8.1f  max %8.1f us\n";
  std::printf(form, name, values.size(), at(0.5), at(0.99), at(0.999), values.back());
}

int measure(const Settings& settings) {
  results.lateness.reserve(static_cast<std::size_t>(settings.seconds * 100) + 100);
  results.round_trip.reserve(results.lateness.capacity());
  const pid_t echo = ::fork();
  if (echo == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    const Result<void> served = serve(settings, "adit_jitter_echo", {});
    if (!served) std::fprintf(stderr, "adit_jitter: %s\n", served.error().message.c_str());
    ::_exit(1);
  }
  std::vector<std::jthread> burners;
  for (int i = 0; i < settings.load; ++i) burners.emplace_back(burn);
  Result<void> served;
  {
    std::jthread probe([&](std::stop_token stop) { served = serve(settings, "adit_jitter_probe", stop); });
    std::this_thread::sleep_for(std::chrono::duration<double>(settings.seconds));
  }
  burners.clear();
  ::kill(echo, SIGKILL);
  ::waitpid(echo, nullptr, 0);
  if (!served) {
    std::fprintf(stderr, "adit_jitter: %s\n", served.error().message.c_str());
    return 1;
  }
  if (settings.json)
    std::printf("{\"missed_ticks\": %llu, \"sent\": %llu, ", static_cast<unsigned long long>(results.missed),
                static_cast<unsigned long long>(results.sent));
  print(settings.json ? "timer_100hz" : "100 Hz timer", results.lateness, settings.json);
  if (settings.json) std::printf(", ");
  print(settings.json ? "loop_1kb" : "1 KB there, back", results.round_trip, settings.json);
  if (settings.json)
    std::printf("}\n");
  else
    std::printf("%llu ticks missed, %zu of %llu answers\n", static_cast<unsigned long long>(results.missed),
                results.round_trip.size(), static_cast<unsigned long long>(results.sent));
  return results.round_trip.empty() ? 1 : 0;
}

}  // namespace
}  // namespace adit

int main(int argc, char** argv) {
  adit::Settings settings;
  CLI::App app("timer and message jitter with a deployment's executor settings", "adit_jitter");
  app.add_option("--seconds", settings.seconds)->check(CLI::Range(1.0, 3600.0));
  app.add_option("--priority", settings.executor.priority, "SCHED_FIFO 1..99; 0: normal scheduling");
  app.add_option("--cpus", settings.executor.cpus, "run only on these")->delimiter(',');
  app.add_flag("--lock", settings.executor.lock_memory, "mlockall");
  app.add_option("--load", settings.load, "threads at normal priority that compute and sweep memory meanwhile");
  app.add_option("--middleware", settings.vendor, "fastdds or cyclonedds");
  app.add_option("--domain", settings.domain);
  app.add_flag("--json", settings.json);
  CLI11_PARSE(app, argc, argv);
  return adit::measure(settings);
}
