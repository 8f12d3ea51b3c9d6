#include "components/runtime/process.hpp"

#include <algorithm>
#include <condition_variable>
#include <mutex>

#include "components/runtime/component_core.hpp"
#include "components/runtime/heartbeat.hpp"
#include "components/runtime/local_bus.hpp"
#include "components/runtime/log_sink.hpp"
#include "components/runtime/services/services.hpp"
#include "middleware/participant.hpp"

namespace adit {

struct Process::Parts {
  ProcessConfig config;
  std::shared_ptr<LogSink> sink = std::make_shared<LogSink>();
  std::unique_ptr<Logger> log;
  std::unique_ptr<Clock> clock;
  LocalBus bus;
  std::unique_ptr<Participant> participant;
  std::unique_ptr<Executor> executor;
  std::unique_ptr<Executor> service_executor;
  std::vector<std::unique_ptr<Component>> components;
  std::vector<std::unique_ptr<Component>> services;
  std::mutex transitions;
  bool stopped = false;

  std::mutex failure_mutex;
  std::condition_variable_any failure_or_stop;
  bool failed = false;
  bool finished = false;
  std::function<void(const std::string&, const std::string&)> on_failure;

  void component_failed(ComponentCore& core, const std::string& reason) {
    const std::lock_guard lock(failure_mutex);
    failed = true;
    if (on_failure) on_failure(core.full_name(), reason);
    failure_or_stop.notify_all();
  }

  std::vector<ComponentStatus> status() const {
    std::vector<ComponentStatus> status;
    for (const auto& component : components) status.push_back(component->core().status());
    return status;
  }
};

Process::Process() : parts_(std::make_unique<Parts>()) {}

Process::~Process() {
  shutdown();
}

// --- Build ---

Result<std::unique_ptr<Process>> Process::build(const ProcessConfig& config) {
  std::unique_ptr<Process> process(new Process);
  Parts& parts = *process->parts_;
  parts.config = config;
  parts.log = std::make_unique<Logger>(config.name, config.log_level, parts.sink);
  parts.clock = std::make_unique<Clock>(config.use_sim_time ? Clock::Source::simulated : Clock::Source::system);
  for (const ComponentConfig& wanted : config.components) {
    if (wanted.name.empty()) {
      return Error{ErrorCode::invalid_argument, "a component of type '" + wanted.type + "' has no name"};
    }
    auto component = components::create(wanted.type);
    if (!component) return component.error();
    ComponentCore& core = (*component)->core();
    if (auto bound = core.bind(wanted, parts.sink); !bound) return bound.error();
    for (const auto& other : parts.components) {
      if (other->core().full_name() == core.full_name()) {
        return Error{ErrorCode::invalid_argument,
                     "two components are called " + core.full_name() + ": give one another name or namespace"};
      }
    }
    parts.components.push_back(std::move(*component));
  }
  return process;
}

std::vector<PortInfo> Process::ports() const {
  std::vector<PortInfo> all;
  for (const auto& component : parts_->components) {
    const std::vector<PortInfo> ports = component->core().ports();
    all.insert(all.end(), ports.begin(), ports.end());
  }
  return all;
}

std::vector<std::pair<std::string, std::vector<ParamInfo>>> Process::parameters() const {
  std::vector<std::pair<std::string, std::vector<ParamInfo>>> all;
  for (const auto& component : parts_->components) {
    all.emplace_back(component->core().full_name(), component->core().parameters());
  }
  return all;
}

// --- Start ---

Result<void> Process::open() {
  auto participant = adit::open(parts_->config.middleware);
  if (!participant) return participant.error();
  return connect(std::move(*participant));
}

Result<void> Process::connect(std::unique_ptr<Participant> participant) {
  Parts& parts = *parts_;
  parts.participant = std::move(participant);
  if (parts.participant) {
    for (const std::string& warning : warnings_in(parts.participant->explain())) parts.log->warn("{}", warning);
    parts.participant->on_event([&parts](const Event& event) {
      if (event.kind == Event::Kind::qos_mismatch) parts.log->error("{}: {}", event.topic, event.text);
      if (event.kind == Event::Kind::liveliness_lost) parts.log->warn("{}: {}", event.topic, event.text);
    });
  }
  std::vector<std::string> warnings;
  auto executor = Executor::start(parts.config.executor, parts.config.name, warnings);
  if (!executor) return executor.error();
  parts.executor = std::move(*executor);
  for (const std::string& warning : warnings) parts.log->warn("{}", warning);

  Environment environment;
  environment.bus = &parts.bus;
  environment.clock = parts.clock.get();
  environment.scheduler = parts.executor.get();
  environment.participant = parts.participant.get();
  environment.on_failure = [&parts](ComponentCore& core, const std::string& reason) {
    parts.component_failed(core, reason);
  };
  environment.on_finished = [&parts] {
    const std::lock_guard lock(parts.failure_mutex);
    parts.finished = true;
    parts.failure_or_stop.notify_all();
  };
  for (const auto& component : parts.components) component->core().connect(environment);

  ServiceConfig services;
  services.process = parts.config.name;
  services.clock = parts.config.use_sim_time;
  services.diagnostics = parts.config.diagnostics;
  services.rosout = parts.config.rosout;
  services.sink = parts.sink;
  services.set_clock = [&parts](Time now) {
    const Clock::Step step = parts.clock->set(now);
    for (const auto& component : parts.components) component->core().time_changed(step);
  };
  services.status = [&parts] { return parts.status(); };
  auto made = make_services(services);
  if (!made) return made.error();
  parts.services = std::move(*made);
  if (parts.services.empty()) return {};
  // Not real-time, and never behind a component's long handler.
  auto service_executor = Executor::start({}, parts.config.name + "-srv", warnings);
  if (!service_executor) return service_executor.error();
  parts.service_executor = std::move(*service_executor);
  environment.scheduler = parts.service_executor.get();
  for (const auto& service : parts.services) service->core().connect(environment);
  return {};
}

Result<void> Process::start() {
  const auto start_all = [this]() -> Result<void> {
    for (const auto& service : parts_->services) {
      if (auto result = service->core().configure(); !result) return result;
      if (auto result = service->core().activate(); !result) return result;
    }
    for (std::size_t i = 0; i < parts_->components.size(); ++i) {
      if (parts_->config.components[i].start == LifecycleState::unconfigured) continue;
      if (auto result = parts_->components[i]->core().configure(); !result) return result;
    }
    for (std::size_t i = 0; i < parts_->components.size(); ++i) {
      if (parts_->config.components[i].start != LifecycleState::active) continue;
      if (auto result = parts_->components[i]->core().activate(); !result) return result;
    }
    return {};
  };
  Result<void> result = start_all();
  if (!result) shutdown();
  return result;
}

Result<void> Process::bring(const std::string& name, LifecycleState wanted) {
  const std::lock_guard lock(parts_->transitions);
  for (const auto& component : parts_->components) {
    ComponentCore& core = component->core();
    if (core.full_name() != name) continue;
    while (core.state() != wanted) {
      const LifecycleState state = core.state();
      Result<void> step;
      if (state == LifecycleState::finalized || wanted == LifecycleState::finalized) {
        if (state == LifecycleState::finalized) {
          return Error{ErrorCode::unavailable, name + " is finalized: restart its process"};
        }
        core.shutdown();
      } else if (state < wanted) {
        step = state == LifecycleState::unconfigured ? core.configure() : core.activate();
      } else {
        step = state == LifecycleState::active ? core.deactivate() : core.cleanup();
      }
      if (!step) return step;
    }
    return {};
  }
  std::string known;
  for (const auto& component : parts_->components) {
    known += (known.empty() ? "" : ", ") + component->core().full_name();
  }
  return Error{ErrorCode::not_found, "no component " + name + " in this process; there are: " + known};
}

// --- Run, stop ---

int Process::run(std::stop_token stop) {
  Parts& parts = *parts_;
  Heartbeat heartbeat = Heartbeat::from_environment();
  const bool supervised = heartbeat.wanted();
  std::unique_lock lock(parts.failure_mutex);
  const auto ends = [&] {
    return stop.stop_requested() || parts.finished || (parts.failed && parts.config.exit_when_a_component_fails);
  };
  while (!ends()) {
    if (supervised) {
      lock.unlock();
      heartbeat.beat(parts.config.name, parts.status());
      lock.lock();
      parts.failure_or_stop.wait_for(lock, stop, heartbeat.interval(), ends);
    } else {
      parts.failure_or_stop.wait(lock, stop, ends);
    }
  }
  return parts.failed ? 1 : 0;
}

void Process::shutdown() {
  Parts& parts = *parts_;
  const std::lock_guard lock(parts.transitions);
  if (std::exchange(parts.stopped, true)) return;
  const auto stop_all = [](auto& components) {
    for (auto component = components.rbegin(); component != components.rend(); ++component) {
      (*component)->core().shutdown();
    }
  };
  stop_all(parts.components);
  stop_all(parts.services);
  if (parts.participant) parts.participant->on_event(nullptr);
  parts.executor.reset();
  parts.service_executor.reset();
}

std::vector<ComponentStatus> Process::status() const {
  return parts_->status();
}

std::string Process::explain() const {
  return parts_->participant ? parts_->participant->explain() : "no middleware: only the local bus\n";
}

Participant* Process::participant() const {
  return parts_->participant.get();
}

Logger& Process::log() {
  return *parts_->log;
}

void Process::on_failure(std::function<void(const std::string&, const std::string&)> handler) {
  const std::lock_guard lock(parts_->failure_mutex);
  parts_->on_failure = std::move(handler);
}

}  // namespace adit
