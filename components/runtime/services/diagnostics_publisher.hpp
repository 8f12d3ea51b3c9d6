#pragma once

#include <functional>
#include <string>
#include <vector>

#include "components/runtime/component.hpp"
#include "diagnostic_msgs/msg/diagnostic_array.hpp"

namespace adit {

// One DiagnosticStatus a component, once a second of system time: lifecycle, health with its reason, counters.
class DiagnosticsPublisher final : public Component {
 public:
  DiagnosticsPublisher(std::string process, std::function<std::vector<ComponentStatus>()> status)
      : process_(std::move(process)), status_(std::move(status)) {}

 private:
  void publish();

  std::string process_;
  std::function<std::vector<ComponentStatus>()> status_;
  Output<diagnostic_msgs::msg::DiagnosticArray> diagnostics_{*this, "/diagnostics", Qos::reliable(10)};
  Timer timer_{*this, "publish", std::chrono::seconds(1), [this] { publish(); }};
};

// The status as /diagnostics carries it.
diagnostic_msgs::msg::DiagnosticStatus to_diagnostic(const ComponentStatus& status, const std::string& process);

}  // namespace adit
