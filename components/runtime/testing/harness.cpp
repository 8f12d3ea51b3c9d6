#include "components/runtime/testing/harness.hpp"

#include <stdexcept>

namespace adit::testing {
namespace {

void require(const Result<void>& result) {
  if (!result) throw std::runtime_error(result.error().message);
}

}  // namespace

Harness::Harness(int threads, std::unique_ptr<Participant> participant, Clock::Source clock_source)
    : clock(clock_source), participant_(std::move(participant)) {
  if (threads == 0) return;
  ExecutorConfig config;
  config.threads = threads;
  std::vector<std::string> warnings;
  auto executor = Executor::start(config, "test", warnings);
  if (!executor) throw std::runtime_error(executor.error().message);
  executor_ = std::move(*executor);
}

Harness::~Harness() {
  for (auto component = components_.rbegin(); component != components_.rend(); ++component) {
    (*component)->core().shutdown();
  }
}

void Harness::add(std::unique_ptr<Component> component, const ComponentConfig& config) {
  require(component->core().bind(config, sink));
  Environment environment;
  environment.bus = &bus;
  environment.clock = &clock;
  environment.scheduler = executor_ ? static_cast<Scheduler*>(executor_.get()) : &inline_;
  environment.participant = participant_.get();
  environment.on_failure = [this](ComponentCore& core, const std::string& reason) {
    const std::lock_guard lock(mutex_);
    failures_.push_back(core.full_name() + " " + reason);
  };
  component->core().connect(environment);
  components_.push_back(std::move(component));
}

std::vector<std::string> Harness::failures() const {
  const std::lock_guard lock(mutex_);
  return failures_;
}

void Harness::start() {
  for (const auto& component : components_) require(component->core().configure());
  for (const auto& component : components_) require(component->core().activate());
}

void Harness::set_time(Time time) {
  const Clock::Step step = clock.set(time);
  for (const auto& component : components_) component->core().time_changed(step);
}

}  // namespace adit::testing
