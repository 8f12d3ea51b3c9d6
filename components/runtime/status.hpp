// What a component tells about itself: for /diagnostics, the supervisor's table and tests.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "components/runtime/port.hpp"
#include "components/runtime/timer.hpp"

namespace adit {

// The states of ROS 2 managed nodes (design.ros2.org, node lifecycle), by their lifecycle_msgs/State values.
enum class LifecycleState : std::uint8_t { unconfigured = 1, inactive = 2, active = 3, finalized = 4 };
std::string_view to_string(LifecycleState state);

// By the values of diagnostic_msgs/DiagnosticStatus.
enum class Health : std::uint8_t { ok = 0, warn = 1, error = 2, stale = 3 };
std::string_view to_string(Health health);

struct InputStatus {
  std::string name, topic;
  InputStats stats;
};

struct OutputStatus {
  std::string name, topic;
  OutputStats stats;
};

struct ComponentStatus {
  std::string name;  // fully qualified
  std::string type;
  LifecycleState state{};
  Health health{};
  std::string reason;       // why health is what it is; may be empty
  bool failed = false;      // a handler or a transition threw: stopped for good
  double cpu_seconds = 0;   // spent in its handlers and timers
  double busy_seconds = 0;  // how long the handler that runs now has been running; 0 when none does
  std::vector<InputStatus> inputs;
  std::vector<OutputStatus> outputs;
  std::vector<TimerStats> timers;
};

}  // namespace adit
