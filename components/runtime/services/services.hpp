// What every process does beside its components: follow /clock, publish /diagnostics and /rosout. Built from the same
// Component class; run by an executor of their own.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "components/runtime/component.hpp"
#include "components/runtime/log_sink.hpp"

namespace adit {

struct ServiceConfig {
  std::string process;
  bool clock = false;
  bool diagnostics = true;
  bool rosout = true;
  std::shared_ptr<LogSink> sink;
  std::function<void(Time)> set_clock;
  std::function<std::vector<ComponentStatus>()> status;
};

Result<std::vector<std::unique_ptr<Component>>> make_services(const ServiceConfig& config);

}  // namespace adit
