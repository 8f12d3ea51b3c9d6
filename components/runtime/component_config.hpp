// How a deployment names, connects and sets one component.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "components/runtime/log.hpp"
#include "components/runtime/port.hpp"
#include "components/runtime/status.hpp"
#include "components/runtime/value.hpp"

namespace adit {

// What is not given stays as the component has it.
struct InputOverride {
  std::optional<std::size_t> queue;
  std::optional<WhenFull> when_full;
  std::optional<Qos::Reliability> reliability;
};

struct ComponentConfig {
  std::string type;  // as registered: "lidar_odometry"
  std::string name;  // its node in the ROS graph is namespace_ + name
  std::string namespace_ = "/";
  std::map<std::string, std::string> remap;  // port name, or the topic it stands for -> topic
  std::map<std::string, InputOverride> inputs;
  Value parameters;  // a map; nested maps are names with dots
  LogLevel log_level = LogLevel::info;
  // What Process::start() brings it to: unconfigured, inactive or active (a restarted process restores what was).
  LifecycleState start = LifecycleState::active;
};

}  // namespace adit
