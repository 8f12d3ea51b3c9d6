#include "components/runtime/offline_runner.hpp"

#include "components/runtime/component_core.hpp"
#include "components/runtime/inline_scheduler.hpp"
#include "components/runtime/local_bus.hpp"
#include "components/runtime/log_sink.hpp"

namespace adit {

struct OfflineRunner::Parts {
  std::shared_ptr<LogSink> sink = std::make_shared<LogSink>();
  Clock clock{Clock::Source::simulated};
  LocalBus bus;
  InlineScheduler scheduler;
  std::vector<std::unique_ptr<Component>> components;
  std::string failure;
};

OfflineRunner::OfflineRunner() : parts_(std::make_unique<Parts>()) {}

OfflineRunner::~OfflineRunner() {
  for (auto component = parts_->components.rbegin(); component != parts_->components.rend(); ++component) {
    (*component)->core().shutdown();
  }
}

Result<std::unique_ptr<OfflineRunner>> OfflineRunner::build(const std::vector<ComponentConfig>& configs) {
  std::unique_ptr<OfflineRunner> runner(new OfflineRunner);
  Parts& parts = *runner->parts_;
  Environment environment;
  environment.bus = &parts.bus;
  environment.clock = &parts.clock;
  environment.scheduler = &parts.scheduler;
  environment.offline = true;
  environment.on_failure = [&parts](ComponentCore& core, const std::string& reason) {
    if (parts.failure.empty()) parts.failure = core.full_name() + " " + reason;
  };
  for (const ComponentConfig& config : configs) {
    auto component = components::create(config.type);
    if (!component) return component.error();
    if (auto bound = (*component)->core().bind(config, parts.sink); !bound) return bound.error();
    (*component)->core().connect(environment);
    parts.components.push_back(std::move(*component));
  }
  return runner;
}

void OfflineRunner::tap(const std::string& topic, Sink sink) {
  parts_->bus.topic(topic).tap(std::move(sink));
}

void OfflineRunner::tap_cdr(const std::string& topic, std::function<void(Bytes, Time)> sink) {
  tap(topic, [sink = std::move(sink), buffer = std::vector<std::byte>()](
                 const ErasedType& type, const std::shared_ptr<const void>& message, const MessageInfo& info) mutable {
    buffer.resize(type.encoded_size(message.get()));
    sink(Bytes(buffer.data(), type.encode(message.get(), buffer)), info.source_time);
  });
}

Result<void> OfflineRunner::start() {
  for (const auto& component : parts_->components) {
    if (auto result = component->core().configure(); !result) return result;
  }
  for (const auto& component : parts_->components) {
    if (auto result = component->core().activate(); !result) return result;
  }
  parts_->scheduler.run_until_idle();
  return check_components();
}

Result<OfflineStats> OfflineRunner::run(OfflineSource& source) {
  OfflineStats stats;
  OfflineMessage message;
  for (bool first = true;; first = false) {
    const Result<bool> more = source.next(message);
    if (!more) return more.error();
    if (!*more) break;
    if (first) {
      parts_->clock.set(message.stamp);
      stats.first = stats.last = message.stamp;
      if (auto started = start(); !started) return started.error();
    }
    if (message.stamp < stats.last) {
      ++stats.out_of_order;
    } else {
      advance_to(message.stamp);
      stats.last = message.stamp;
    }
    const Result<bool> heard = deliver(message);
    if (!heard) return heard.error();
    ++(*heard ? stats.delivered : stats.unheard);
    if (auto fine = check_components(); !fine) return fine.error();
  }
  for (const auto& component : parts_->components) {
    if (component->core().state() != LifecycleState::active) continue;
    if (auto result = component->core().deactivate(); !result) return result.error();
    parts_->scheduler.run_until_idle();
    if (auto result = component->core().cleanup(); !result) return result.error();
  }
  return stats;
}

// Fires the timers on the way, in the order of their ticks.
void OfflineRunner::advance_to(Time time) {
  while (true) {
    Time next = time;
    for (const auto& component : parts_->components) {
      if (const auto tick = component->core().next_simulated_tick()) next = std::min(next, *tick);
    }
    const Clock::Step step = parts_->clock.set(next);
    for (const auto& component : parts_->components) component->core().time_changed(step);
    parts_->scheduler.run_until_idle();
    if (next == time) return;
  }
}

Result<bool> OfflineRunner::deliver(const OfflineMessage& message) {
  LocalTopic& topic = parts_->bus.topic(message.topic);
  if (!topic.has_inputs()) return false;
  const ErasedType& wanted = *topic.type();
  if (message.object && message.type->info->dds_name != wanted.info->dds_name) {
    return Error{ErrorCode::incompatible, message.topic + ": the source has " +
                                              std::string(message.type->info->ros_name) + ", the components want " +
                                              std::string(wanted.info->ros_name)};
  }
  MessageInfo info;
  info.source_time = info.received_time = message.stamp;
  topic.inject(message.object, message.cdr, message.memory, info);
  parts_->scheduler.run_until_idle();
  return true;
}

Result<void> OfflineRunner::check_components() const {
  if (!parts_->failure.empty()) return Error{ErrorCode::internal, parts_->failure};
  for (const auto& component : parts_->components) {
    if (component->core().refused_messages() == 0) continue;
    for (const InputStatus& input : component->core().status().inputs) {
      if (input.stats.refused == 0) continue;
      return Error{ErrorCode::malformed, input.topic + ": a message cannot be decoded: " + input.stats.last_refusal};
    }
  }
  return {};
}

std::vector<PortInfo> OfflineRunner::ports() const {
  std::vector<PortInfo> all;
  for (const auto& component : parts_->components) {
    const std::vector<PortInfo> ports = component->core().ports();
    all.insert(all.end(), ports.begin(), ports.end());
  }
  return all;
}

std::vector<ComponentStatus> OfflineRunner::status() const {
  std::vector<ComponentStatus> status;
  for (const auto& component : parts_->components) status.push_back(component->core().status());
  return status;
}

}  // namespace adit
