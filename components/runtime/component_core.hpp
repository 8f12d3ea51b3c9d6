// The runtime's side of a component: its strand, its lifecycle, its lists of ports. Not for component authors.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "components/runtime/component.hpp"
#include "components/runtime/component_config.hpp"
#include "components/runtime/scheduler.hpp"

namespace adit {

class LocalBus;
class LogSink;
class Participant;

// What a component runs in; everything outlives it.
struct Environment {
  LocalBus* bus = nullptr;
  Clock* clock = nullptr;
  Scheduler* scheduler = nullptr;
  Participant* participant = nullptr;  // nullptr: only the local bus
  // Offline: queues grow instead of dropping (the caller waits for the component anyway), and messages are stamped by
  // the simulated clock.
  bool offline = false;
  std::function<void(ComponentCore&, const std::string& reason)> on_failure;
  std::function<void()> on_finished;
};

class ComponentCore final : public Strand {
 public:
  explicit ComponentCore(Component& component) : component_(component) {}

  // --- Called by Process and OfflineRunner, one thread at a time -----------------------------------------------------
  // Names, parameters, remaps: everything that can be wrong before DDS is opened.
  Result<void> bind(const ComponentConfig& config, std::shared_ptr<LogSink> sink);
  void connect(const Environment& environment);
  Result<void> configure();
  Result<void> activate();
  Result<void> deactivate();
  Result<void> cleanup();
  // Any state -> finalized. The component does not run any more when it returns.
  void shutdown();
  // The simulated clock was moved: timers that are due fire; after a step back, which is reported, and after the very
  // first time they start over.
  void time_changed(const Clock::Step& step);
  // The earliest tick of its timers on the simulated clock.
  std::optional<Time> next_simulated_tick() const;

  // --- Any thread ----------------------------------------------------------------------------------------------------
  LifecycleState state() const { return state_; }
  bool failed() const { return failed_; }
  ComponentStatus status() const;
  std::uint64_t refused_messages() const;  // by all inputs: could not be decoded
  std::vector<PortInfo> ports() const;
  std::vector<ParamInfo> parameters() const;
  const std::string& type() const { return type_; }
  const std::string& name() const { return name_; }
  const std::string& full_name() const { return full_name_; }
  // How long the handler that runs now has been running.
  Duration busy_for() const;
  void set_health(Health level, std::string reason);
  void finish() {
    if (environment_.on_finished) environment_.on_finished();
  }

  // --- The component's members ---------------------------------------------------------------------------------------
  void add(InputBase& input) { inputs_.push_back(&input); }
  void add(OutputBase& output) { outputs_.push_back(&output); }
  void add(ParamBase& param) { params_.push_back(&param); }
  void add(Timer& timer) { timers_.push_back(&timer); }
  void add(Trigger& trigger) { triggers_.push_back(&trigger); }
  void remove(InputBase& input) { std::erase(inputs_, &input); }
  void remove(OutputBase& output) { std::erase(outputs_, &output); }
  void remove(ParamBase& param) { std::erase(params_, &param); }
  void remove(Timer& timer) { std::erase(timers_, &timer); }
  void remove(Trigger& trigger) { std::erase(triggers_, &trigger); }

  const Environment& environment() const { return environment_; }
  const Clock& clock() const { return *environment_.clock; }
  Logger& log() { return *log_; }
  std::mutex& queue_mutex() { return queue_mutex_; }
  std::uint64_t next_order() { return ++arrivals_; }  // caller holds the queue mutex
  void wake();
  // Now, on the scale the timers count in.
  Duration::rep timer_now() const;
  // When a message is published or received, for MessageInfo.
  Time message_now() const { return environment_.offline ? clock().now() : system_now(); }

 private:
  bool run_one() override;
  // Each runs one handler, if there is something to run: the timer that has been due longest, the first trigger, the
  // message that arrived first.
  bool fire_due_timer();
  bool run_raised_trigger();
  bool handle_next_message();
  bool more_to_do();
  void set_alarm();
  Result<void> open_ports();
  void close_ports();
  void stop_ports();
  void fail(const std::string& what);
  Result<void> transition(LifecycleState from, LifecycleState to, const char* verb,
                          const std::function<Result<void>()>& work);
  std::string resolve_topic(const std::string& port) const;

  Component& component_;
  std::string type_ = "?";
  std::string name_ = "?";
  std::string namespace_ = "/";
  std::string full_name_ = "a component";
  std::map<std::string, std::string> remap_;
  Environment environment_;
  std::unique_ptr<Logger> log_;
  std::vector<InputBase*> inputs_;
  std::vector<OutputBase*> outputs_;
  std::vector<ParamBase*> params_;
  std::vector<Timer*> timers_;
  std::vector<Trigger*> triggers_;

  std::mutex running_;         // held while the component's code runs
  bool message_turn_ = false;  // under running_: a timer or trigger ran last
  std::mutex queue_mutex_;
  std::uint64_t arrivals_ = 0;
  std::atomic<LifecycleState> state_{LifecycleState::unconfigured};
  std::atomic<bool> failed_{false};
  std::atomic<bool> connected_{false};
  std::atomic<Duration::rep> pending_jump_{0};
  std::atomic<bool> restart_timers_{false};
  std::atomic<std::int64_t> cpu_ns_{0};
  std::atomic<Duration::rep> busy_since_{0};  // steady clock; 0: idle

  mutable std::mutex health_mutex_;
  Health health_ = Health::ok;
  std::string health_reason_;
};

}  // namespace adit
