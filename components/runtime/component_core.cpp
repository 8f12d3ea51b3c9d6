#include "components/runtime/component_core.hpp"

#include <algorithm>
#include <ctime>
#include <exception>
#include <utility>

#include "components/runtime/log_sink.hpp"

namespace adit {
namespace {

std::int64_t thread_cpu_ns() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

Duration::rep steady_ns() {
  return std::chrono::steady_clock::now().time_since_epoch().count();
}

// A component's code must not bring the process down: whatever it throws becomes an error.
Result<void> guarded(const std::function<Result<void>()>& work) {
  try {
    return work();
  } catch (const std::exception& exception) {
    return Error{ErrorCode::internal, std::string("threw an exception: ") + exception.what()};
  } catch (...) {
    return Error{ErrorCode::internal, "threw something that is not a std::exception"};
  }
}

template <class T>
std::string names_of(const std::vector<T*>& ports) {
  std::string text;
  for (const T* port : ports) text += (text.empty() ? "" : ", ") + port->name();
  return text.empty() ? "none" : text;
}

}  // namespace

// --- Names, parameters ---

Result<void> ComponentCore::bind(const ComponentConfig& config, std::shared_ptr<LogSink> sink) {
  type_ = config.type;
  name_ = config.name;
  namespace_ = config.namespace_;
  full_name_ = resolve_name(name_, namespace_, name_);
  remap_ = config.remap;
  std::string logger = full_name_.substr(1);  // as rcl names it: "perception.lidar_odometry"
  std::replace(logger.begin(), logger.end(), '/', '.');
  log_ = std::make_unique<Logger>(logger, config.log_level, std::move(sink));

  for (const auto& [from, to] : remap_) {
    const auto is_from = [&, &port_name = from](const auto* port) {
      return port->name() == port_name || resolve_name(port->name(), namespace_, name_) == port_name;
    };
    if (std::none_of(inputs_.begin(), inputs_.end(), is_from) &&
        std::none_of(outputs_.begin(), outputs_.end(), is_from)) {
      return Error{ErrorCode::not_found, full_name_ + " has no port '" + from + "' to remap; its inputs: " +
                                             names_of(inputs_) + "; its outputs: " + names_of(outputs_)};
    }
  }
  for (const auto& [port, unused] : config.inputs) {
    const auto has_name = [&wanted = port](const InputBase* input) { return input->name() == wanted; };
    if (std::none_of(inputs_.begin(), inputs_.end(), has_name)) {
      return Error{ErrorCode::not_found, full_name_ + " has no input '" + port + "'; its inputs: " + names_of(inputs_)};
    }
  }
  for (InputBase* input : inputs_) {
    Queue queue = input->queue_;
    Qos::Reliability reliability = input->qos_.reliability;
    if (const auto found = config.inputs.find(input->name()); found != config.inputs.end()) {
      queue.size = found->second.queue.value_or(queue.size);
      queue.when_full = found->second.when_full.value_or(queue.when_full);
      reliability = found->second.reliability.value_or(reliability);
    }
    if (queue.size < 1 || queue.size > 100'000) {
      return Error{ErrorCode::invalid_argument, full_name_ + ": input '" + input->name() + "' has a queue of " +
                                                    std::to_string(queue.size) + ", give 1..100000"};
    }
    input->bind(resolve_topic(input->name()), queue, reliability);
  }
  for (OutputBase* output : outputs_) output->bind(resolve_topic(output->name()));
  return set_parameters(params_, config.parameters, full_name_);
}

std::string ComponentCore::resolve_topic(const std::string& port) const {
  const std::string topic = resolve_name(port, namespace_, name_);
  for (const std::string& from : {port, topic}) {
    if (const auto found = remap_.find(from); found != remap_.end()) {
      return resolve_name(found->second, namespace_, name_);
    }
  }
  return topic;
}

std::vector<PortInfo> ComponentCore::ports() const {
  std::vector<PortInfo> ports;
  for (const InputBase* input : inputs_) ports.push_back(input->info());
  for (const OutputBase* output : outputs_) ports.push_back(output->info());
  return ports;
}

std::vector<ParamInfo> ComponentCore::parameters() const {
  std::vector<ParamInfo> parameters;
  for (const ParamBase* param : params_) parameters.push_back(param->info());
  return parameters;
}

// --- Lifecycle ---

void ComponentCore::connect(const Environment& environment) {
  environment_ = environment;
  environment_.scheduler->add(*this);
  connected_ = true;
}

Result<void> ComponentCore::transition(LifecycleState from, LifecycleState to, const char* verb,
                                       const std::function<Result<void>()>& work) {
  const std::lock_guard lock(running_);
  if (state_ != from) {
    return Error{ErrorCode::unavailable, full_name_ + " is " + std::string(to_string(state_)) + ": cannot " + verb +
                                             ", which needs it to be " + std::string(to_string(from))};
  }
  Result<void> result = guarded(work);
  if (!result) {
    const std::string reason = std::string(verb) + " failed: " + result.error().message;
    log_->error("{}", reason);
    set_health(Health::error, reason);
    return Error{result.error().code, full_name_ + ": " + reason};
  }
  state_ = to;
  log_->debug("{}", to_string(to));
  return {};
}

Result<void> ComponentCore::configure() {
  return transition(LifecycleState::unconfigured, LifecycleState::inactive, "configure", [this]() -> Result<void> {
    if (auto result = component_.configure(); !result) return result;
    auto opened = open_ports();
    if (!opened) {
      close_ports();
      static_cast<void>(guarded([this] { return component_.cleanup(); }));
    }
    return opened;
  });
}

Result<void> ComponentCore::activate() {
  return transition(LifecycleState::inactive, LifecycleState::active, "activate", [this]() -> Result<void> {
    for (OutputBase* output : outputs_) output->start();
    for (Trigger* trigger : triggers_) trigger->take();
    if (auto result = guarded([this] { return component_.activate(); }); !result) {
      stop_ports();
      return result;
    }
    const Duration::rep now = timer_now();
    for (Timer* timer : timers_) timer->arm(now);
    for (InputBase* input : inputs_) input->start();
    // The state changes when this returns; the strand may look at it only then, because `running_` is held.
    wake();
    return {};
  });
}

Result<void> ComponentCore::deactivate() {
  return transition(LifecycleState::active, LifecycleState::inactive, "deactivate", [this] {
    for (InputBase* input : inputs_) input->stop();
    for (Timer* timer : timers_) timer->disarm();
    const Result<void> result = component_.deactivate();
    stop_ports();
    return result;
  });
}

Result<void> ComponentCore::cleanup() {
  return transition(LifecycleState::inactive, LifecycleState::unconfigured, "clean up", [this] {
    const Result<void> result = component_.cleanup();
    close_ports();
    return result;
  });
}

void ComponentCore::shutdown() {
  // Errors are logged by the transitions; going down goes on.
  if (state_ == LifecycleState::active) static_cast<void>(deactivate());
  if (state_ == LifecycleState::inactive) static_cast<void>(cleanup());
  if (connected_.exchange(false)) environment_.scheduler->remove(*this);
  const std::lock_guard lock(running_);
  stop_ports();
  close_ports();
  state_ = LifecycleState::finalized;
}

Result<void> ComponentCore::open_ports() {
  for (OutputBase* output : outputs_) {
    if (auto result = output->open(environment_.participant, *environment_.bus); !result) return result;
  }
  for (InputBase* input : inputs_) {
    if (auto result = input->open(environment_.participant, *environment_.bus); !result) return result;
  }
  return {};
}

void ComponentCore::stop_ports() {
  for (InputBase* input : inputs_) input->stop();
  for (Timer* timer : timers_) timer->disarm();
  for (OutputBase* output : outputs_) output->stop();
}

void ComponentCore::close_ports() {
  for (InputBase* input : inputs_) input->close();
  for (OutputBase* output : outputs_) output->close();
}

// Called in the strand.
void ComponentCore::fail(const std::string& what) {
  const std::string reason = "stopped: a handler " + what;
  failed_ = true;
  log_->error("{}", reason);
  stop_ports();
  static_cast<void>(guarded([this] { return component_.deactivate(); }));
  static_cast<void>(guarded([this] { return component_.cleanup(); }));
  close_ports();
  state_ = LifecycleState::finalized;
  set_health(Health::error, reason);
  if (environment_.on_failure) environment_.on_failure(*this, reason);
}

// --- Running ---

void ComponentCore::wake() {
  if (connected_) environment_.scheduler->schedule(*this);
}

Duration::rep ComponentCore::timer_now() const {
  return clock().simulated() ? clock().now().time_since_epoch().count() : steady_ns();
}

void ComponentCore::time_changed(const Clock::Step& step) {
  if (state_ != LifecycleState::active) return;
  if (step.by < Duration::zero()) pending_jump_.fetch_add(step.by.count());
  if (step.by < Duration::zero() || step.first) restart_timers_ = true;
  wake();
}

std::optional<Time> ComponentCore::next_simulated_tick() const {
  Duration::rep next = Timer::never;
  for (const Timer* timer : timers_) next = std::min(next, timer->next_);
  if (next == Timer::never) return {};
  return Time(Duration(next));
}

bool ComponentCore::run_one() {
  const std::lock_guard lock(running_);
  if (state_ != LifecycleState::active) return false;
  busy_since_.store(steady_ns(), std::memory_order_relaxed);
  // An executor's thread does nothing but this: what it used since it last came here (waking up, choosing) is the price
  // of what it does now. Reading that clock is a system call, so once a handler is enough.
  thread_local std::int64_t counted_until = 0;
  const std::int64_t cpu_before = environment_.offline || counted_until == 0 ? thread_cpu_ns() : counted_until;
  bool more = false;
  try {
    if (restart_timers_.exchange(false)) {
      for (Timer* timer : timers_) timer->arm(timer_now());
    }
    if (const Duration::rep jump = pending_jump_.exchange(0); jump != 0) component_.on_time_jump(Duration(jump));
    for (InputBase* input : inputs_) input->drain_reader();
    // After a timer or trigger a waiting message has its turn, so that one that takes longer than its period starves
    // nobody.
    if (!std::exchange(message_turn_, false) || !handle_next_message()) {
      message_turn_ = fire_due_timer() || run_raised_trigger();
      if (!message_turn_) handle_next_message();
    }
    more = more_to_do();
  } catch (const std::exception& exception) {
    fail(std::string("threw an exception: ") + exception.what());
  } catch (...) {
    fail("threw something that is not a std::exception");
  }
  counted_until = thread_cpu_ns();
  cpu_ns_.fetch_add(counted_until - cpu_before, std::memory_order_relaxed);
  busy_since_.store(0, std::memory_order_relaxed);
  if (!more) set_alarm();
  return more;
}

bool ComponentCore::fire_due_timer() {
  if (timers_.empty()) return false;
  const Duration::rep now = timer_now();
  Timer* const first = *std::min_element(timers_.begin(), timers_.end(),
                                         [](const Timer* a, const Timer* b) { return a->next_ < b->next_; });
  if (!first->due(now)) return false;
  first->fire(now, clock().now());
  return true;
}

bool ComponentCore::run_raised_trigger() {
  for (Trigger* trigger : triggers_) {
    if (!trigger->take()) continue;
    trigger->handler_();
    return true;
  }
  return false;
}

bool ComponentCore::handle_next_message() {
  InputBase* first = nullptr;
  {
    const std::lock_guard lock(queue_mutex_);
    std::uint64_t first_order = std::numeric_limits<std::uint64_t>::max();
    for (InputBase* input : inputs_) {
      if (const auto order = input->next_order(); order && *order < first_order) {
        first = input;
        first_order = *order;
      }
    }
  }
  if (first) first->handle_next();
  return first != nullptr;
}

bool ComponentCore::more_to_do() {
  if (!timers_.empty()) {
    const Duration::rep now = timer_now();
    if (std::any_of(timers_.begin(), timers_.end(), [now](const Timer* timer) { return timer->due(now); })) return true;
  }
  if (std::any_of(triggers_.begin(), triggers_.end(), [](const Trigger* trigger) { return trigger->raised(); })) {
    return true;
  }
  const std::lock_guard lock(queue_mutex_);
  return std::any_of(inputs_.begin(), inputs_.end(),
                     [](const InputBase* input) { return input->next_order() || input->reader_ready_; });
}

void ComponentCore::set_alarm() {
  if (timers_.empty() || clock().simulated()) return;
  Duration::rep next = Timer::never;
  for (const Timer* timer : timers_) next = std::min(next, timer->next_);
  environment_.scheduler->set_alarm(*this,
                                    next == Timer::never ? SteadyTime::max() : SteadyTime(SteadyTime::duration(next)));
}

// --- Telling ---

void ComponentCore::set_health(Health level, std::string reason) {
  const std::lock_guard lock(health_mutex_);
  health_ = level;
  health_reason_ = std::move(reason);
}

Duration ComponentCore::busy_for() const {
  const Duration::rep since = busy_since_.load(std::memory_order_relaxed);
  return since == 0 ? Duration::zero() : Duration(steady_ns() - since);
}

std::uint64_t ComponentCore::refused_messages() const {
  std::uint64_t refused = 0;
  for (const InputBase* input : inputs_) refused += input->refused_;
  return refused;
}

ComponentStatus ComponentCore::status() const {
  ComponentStatus status;
  status.name = full_name_;
  status.type = type_;
  status.state = state_;
  status.failed = failed_;
  status.cpu_seconds = 1e-9 * static_cast<double>(cpu_ns_.load());
  status.busy_seconds = std::chrono::duration<double>(busy_for()).count();
  {
    const std::lock_guard lock(health_mutex_);
    status.health = health_;
    status.reason = health_reason_;
  }
  for (const InputBase* input : inputs_) status.inputs.push_back({input->name(), input->topic(), input->stats()});
  for (const OutputBase* output : outputs_)
    status.outputs.push_back({output->name(), output->topic(), output->stats()});
  for (const Timer* timer : timers_) status.timers.push_back(timer->stats());
  return status;
}

}  // namespace adit
