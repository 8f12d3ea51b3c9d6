#include "components/runtime/component.hpp"

#include "components/runtime/component_core.hpp"

namespace adit {

Component::Component() : core_(std::make_unique<ComponentCore>(*this)) {}

Component::~Component() = default;

const std::string& Component::name() const {
  return core_->name();
}

const std::string& Component::full_name() const {
  return core_->full_name();
}

const Clock& Component::clock() const {
  return core_->clock();
}

Logger& Component::log() {
  return core_->log();
}

void Component::finish() {
  core_->finish();
}

void Component::health(Health level, std::string reason) {
  core_->set_health(level, std::move(reason));
}

}  // namespace adit
