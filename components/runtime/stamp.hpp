// Time as messages carry it.
#pragma once

#include "builtin_interfaces/msg/time.hpp"
#include "middleware/time.hpp"

namespace adit {

inline Time to_time(const builtin_interfaces::msg::Time& stamp) {
  return Time(std::chrono::seconds(stamp.sec) + std::chrono::nanoseconds(stamp.nanosec));
}

// Rounds towards the past, so that nanosec is never negative.
inline builtin_interfaces::msg::Time to_stamp(Time time) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(time);
  builtin_interfaces::msg::Time stamp;
  stamp.sec = static_cast<std::int32_t>(seconds.time_since_epoch().count());
  stamp.nanosec = static_cast<std::uint32_t>((time - seconds).count());
  return stamp;
}

}  // namespace adit
