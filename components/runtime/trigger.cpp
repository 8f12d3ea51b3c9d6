#include "components/runtime/trigger.hpp"

#include "components/runtime/component.hpp"
#include "components/runtime/component_core.hpp"

namespace adit {

Trigger::Trigger(Component& owner, std::function<void()> handler) : core_(owner.core()), handler_(std::move(handler)) {
  core_.add(*this);
}

Trigger::~Trigger() {
  core_.remove(*this);
}

void Trigger::raise() {
  if (!raised_.exchange(true, std::memory_order_acq_rel)) core_.wake();
}

}  // namespace adit
