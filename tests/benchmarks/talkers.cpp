// Small programs as a whole: from the start of the process to its first message at a running listener; memory; size.
#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>

#include <condition_variable>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <thread>

#include "middleware/participant.hpp"
#include "std_msgs/msg/string.hpp"
#include "tests/benchmarks/bare/bare.hpp"
#include "tests/benchmarks/bench.hpp"

extern char** environ;

namespace adit::bench {
namespace {

namespace fs = std::filesystem;

class Listener {
 public:
  Listener(const std::string& vendor, std::uint32_t domain) {
    ParticipantConfig config;
    config.vendor = vendor;
    config.domain = domain;
    auto opened = open(config);
    if (!opened) return;
    participant_ = std::move(*opened);
    EndpointConfig endpoint;
    endpoint.topic = "/chatter";
    endpoint.type = &type_info<std_msgs::msg::String>();
    endpoint.qos = Qos::reliable(10);
    auto reader = participant_->reader(endpoint);
    if (!reader) return;
    reader_ = std::move(*reader);
    reader_->on_data([this] {
      const std::lock_guard lock(mutex_);
      ++signals_;
      if (first_ == 0) first_ = monotonic_ns();
      signal_.notify_one();
    });
  }
  ~Listener() {
    if (reader_) reader_->on_data(nullptr);
  }
  bool valid() const { return reader_ != nullptr; }

  void forget() {
    std::array<Sample, 8> samples;
    while (reader_->take(samples) > 0) {
    }
    const std::lock_guard lock(mutex_);
    first_ = 0;
  }
  // When the next message since forget() was there to take; 0 when none came.
  std::int64_t first(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    signal_.wait_for(lock, timeout, [this] { return first_ != 0; });
    return first_;
  }
  bool nobody_talks() const { return reader_->stats().matched == 0; }

 private:
  std::unique_ptr<Participant> participant_;
  std::unique_ptr<Reader> reader_;
  std::mutex mutex_;
  std::condition_variable signal_;
  std::uint64_t signals_ = 0;
  std::int64_t first_ = 0;
};

pid_t start(const Talker& talker, double seconds, std::uint32_t domain, double hertz) {
  const std::vector<std::string> words = {talker.path, std::to_string(seconds), std::to_string(domain),
                                          std::to_string(hertz)};
  std::vector<char*> arguments, environment;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  std::string vendor = "ADIT_MIDDLEWARE=" + talker.vendor;
  for (char** variable = environ; *variable; ++variable) environment.push_back(*variable);
  environment.push_back(vendor.data());
  environment.push_back(nullptr);
  pid_t process = -1;
  return posix_spawn(&process, talker.path.c_str(), nullptr, nullptr, arguments.data(), environment.data()) == 0
             ? process
             : -1;
}

void end(pid_t process) {
  if (process <= 0) return;
  kill(process, SIGTERM);
  waitpid(process, nullptr, 0);
}

struct Figures {
  std::vector<double> start_ms;
  std::map<std::string, double> memory_mb;  // of /proc/PID/status
  double file_mb = 0;
  std::string failure;
};

std::map<std::string, double> memory_of(pid_t process) {
  std::map<std::string, double> memory;
  std::ifstream status("/proc/" + std::to_string(process) + "/status");
  for (std::string key, rest; status >> key; std::getline(status, rest)) {
    if (key != "VmRSS:" && key != "RssAnon:" && key != "RssFile:" && key != "RssShmem:") continue;
    double kilobytes = 0;
    status >> kilobytes;
    key.pop_back();
    memory[key] = kilobytes * 1024e-6;
  }
  return memory;
}

std::vector<Figures> measure(const std::vector<Talker>& talkers, const std::string& vendor) {
  std::vector<Figures> all(talkers.size());
  const std::uint32_t domain = private_domain();
  Listener listener(vendor, domain);
  const int rounds = settings().quick ? 1 : 10;
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t i = 0; i < talkers.size(); ++i) {
      Figures& figures = all[i];
      if (!listener.valid()) figures.failure = "no listener on " + vendor;
      if (!figures.failure.empty()) continue;
      for (int wait = 0; wait < 100 && !listener.nobody_talks(); ++wait) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
      }
      listener.forget();
      const std::int64_t begin = monotonic_ns();
      const pid_t process = start(talkers[i], 10, domain, 1000);
      const std::int64_t heard = process > 0 ? listener.first(std::chrono::seconds(10)) : 0;
      end(process);
      if (heard == 0) {
        figures.failure = talkers[i].path + (process > 0 ? ": nothing heard" : " does not start");
      } else {
        figures.start_ms.push_back(static_cast<double>(heard - begin) * 1e-6);
      }
    }
  }
  for (std::size_t i = 0; i < talkers.size(); ++i) {
    if (!all[i].failure.empty()) continue;
    const double seconds = settings().quick ? 0.3 : 1.0;
    const pid_t process = start(talkers[i], 10, domain, 10);
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    all[i].memory_mb = memory_of(process);
    end(process);
    std::error_code ignored;
    all[i].file_mb = static_cast<double>(fs::file_size(talkers[i].path, ignored)) * 1e-6;
  }
  return all;
}

void print(const Talker& talker, const Figures& figures) {
  static bool head = false;
  if (!std::exchange(head, true)) {
    print_later(
        "\nTalkers: start to first message       p50 ms   max ms   VmRSS MB  without shm  RssAnon  program MB\n");
  }
  const auto memory = [&](const char* key) {
    const auto found = figures.memory_mb.find(key);
    return found == figures.memory_mb.end() ? 0.0 : found->second;
  };
  print_later("%-10s %-26s %6.1f   %6.1f   %8.2f   %10.2f  %7.2f  %10.2f\n", talker.vendor.c_str(), talker.name.c_str(),
              quantile(figures.start_ms, 0.5), quantile(figures.start_ms, 1.0), memory("VmRSS"),
              memory("VmRSS") - memory("RssShmem"), memory("RssAnon"), figures.file_mb);
}

// All talkers of a vendor are measured in turns, the first time one of them is asked for.
const Figures& measured(const Talker& talker) {
  static std::map<std::string, std::map<std::string, Figures>> by_vendor;
  if (!by_vendor.contains(talker.vendor)) {
    std::vector<Talker> talkers;
    for (const Talker& other : settings().talkers) {
      if (other.vendor == talker.vendor) talkers.push_back(other);
    }
    const std::vector<Figures> figures = measure(talkers, talker.vendor);
    for (std::size_t i = 0; i < talkers.size(); ++i) {
      if (figures[i].failure.empty()) print(talkers[i], figures[i]);
      by_vendor[talker.vendor][talkers[i].name] = figures[i];
    }
  }
  return by_vendor[talker.vendor][talker.name];
}

void report(benchmark::State& state, const Talker& talker) {
  const Figures& figures = measured(talker);
  if (!figures.failure.empty()) return fail(state, figures.failure);
  for (auto _ : state) state.SetIterationTime(quantile(figures.start_ms, 0.5) * 1e-3);
  for (const auto& [key, value] : figures.memory_mb) state.counters[key + "_MB"] = value;
  state.counters["program_MB"] = figures.file_mb;
}

}  // namespace

void register_talkers() {
  const fs::path folder = fs::read_symlink("/proc/self/exe").parent_path();
  auto& talkers = settings().talkers;
  for (const std::string_view vendor : built_in_vendors()) {
    const std::string name(vendor);
    talkers.push_back({name, "ours_shared", folder / "adit_bare_talker"});
    talkers.push_back({name, "bare_vendor", folder / ("adit_bench_" + name + "_talker")});
  }
  for (const Talker& talker : talkers) {
    benchmark::RegisterBenchmark(("talker/" + talker.vendor + "/" + talker.name).c_str(), report, talker)
        ->UseManualTime()
        ->Iterations(1)
        ->Unit(benchmark::kMillisecond);
  }
}

}  // namespace adit::bench
