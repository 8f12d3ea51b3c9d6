#pragma once

#include <chrono>

namespace adit {

using Duration = std::chrono::nanoseconds;
// Nanoseconds since the Unix epoch (system time), or since the start of a simulation when /clock rules.
using Time = std::chrono::sys_time<std::chrono::nanoseconds>;

inline Time system_now() {
  return std::chrono::time_point_cast<Duration>(std::chrono::system_clock::now());
}

}  // namespace adit
