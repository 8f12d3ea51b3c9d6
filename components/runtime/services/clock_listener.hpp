#pragma once

#include <functional>

#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"
#include "rosgraph_msgs/msg/clock.hpp"

namespace adit {

// Lets the process live in the time that /clock tells.
class ClockListener final : public Component {
 public:
  explicit ClockListener(std::function<void(Time)> set_clock) : set_clock_(std::move(set_clock)) {}

 private:
  std::function<void(Time)> set_clock_;
  Input<rosgraph_msgs::msg::Clock> clock_{
      *this, "/clock", Qos::clock(), Queue{1, WhenFull::drop_oldest},
      [this](const rosgraph_msgs::msg::Clock& message, const MessageInfo&) { set_clock_(to_time(message.clock)); }};
};

}  // namespace adit
