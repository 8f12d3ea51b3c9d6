#include "components/runtime/services/services.hpp"

#include "components/runtime/component_config.hpp"
#include "components/runtime/component_core.hpp"
#include "components/runtime/services/clock_listener.hpp"
#include "components/runtime/services/diagnostics_publisher.hpp"
#include "components/runtime/services/rosout_publisher.hpp"

namespace adit {

Result<std::vector<std::unique_ptr<Component>>> make_services(const ServiceConfig& config) {
  std::vector<std::unique_ptr<Component>> services;
  const auto add = [&](std::unique_ptr<Component> service, const char* what) -> Result<void> {
    ComponentConfig binding;
    binding.type = what;
    binding.name = config.process;  // all services of a process are one node
    services.push_back(std::move(service));
    return services.back()->core().bind(binding, config.sink);
  };
  Result<void> added;
  if (config.clock) added = add(std::make_unique<ClockListener>(config.set_clock), "clock_listener");
  if (added && config.diagnostics) {
    added = add(std::make_unique<DiagnosticsPublisher>(config.process, config.status), "diagnostics_publisher");
  }
  if (added && config.rosout) added = add(std::make_unique<RosoutPublisher>(config.sink), "rosout_publisher");
  if (!added) return added.error();
  return services;
}

}  // namespace adit
