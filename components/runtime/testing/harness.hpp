// Runs components under test in one line each: on threads against a FakeDomain, or step by step on this thread.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "components/runtime/component_core.hpp"
#include "components/runtime/executor.hpp"
#include "components/runtime/inline_scheduler.hpp"
#include "components/runtime/local_bus.hpp"
#include "components/runtime/log_sink.hpp"
#include "middleware/participant.hpp"

namespace adit::testing {

// Polls; false when it did not come true in time.
inline bool eventually(const std::function<bool()>& condition, Duration timeout = std::chrono::seconds(10)) {
  const SteadyTime end = std::chrono::steady_clock::now() + timeout;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

// What a process is to its components, without registry and services.
class Harness {
 public:
  // threads 0: nothing runs but in step().
  explicit Harness(int threads = 0, std::unique_ptr<Participant> participant = nullptr,
                   Clock::Source clock_source = Clock::Source::system);
  ~Harness();

  template <class C, class... A>
  C& make(const std::string& name, ComponentConfig config, A&&... arguments) {
    auto component = std::make_unique<C>(std::forward<A>(arguments)...);
    C& made = *component;
    config.type = "test";
    config.name = name;
    add(std::move(component), config);
    return made;
  }
  template <class C>
  C& make(const std::string& name) {
    return make<C>(name, ComponentConfig{});
  }
  void add(std::unique_ptr<Component> component, const ComponentConfig& config);
  // Configures and activates all.
  void start();
  void step() { inline_.run_until_idle(); }
  void set_time(Time time);

  LocalBus bus;
  Clock clock;
  std::shared_ptr<LogSink> sink = std::make_shared<LogSink>(false);
  std::vector<std::string> failures() const;  // so far, in the order of the threads that met them

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> failures_;  // guarded by mutex_
  std::unique_ptr<Participant> participant_;
  InlineScheduler inline_;
  std::unique_ptr<Executor> executor_;
  std::vector<std::unique_ptr<Component>> components_;
};

}  // namespace adit::testing
