#pragma once

#include "middleware/time.hpp"

namespace adit {

// When and how often a process that ended is started again.
struct RestartPolicy {
  enum class When { never, on_failure, always };
  When when = When::on_failure;
  int max = 5;                                        // restarts in a row before giving up; -1: never give up
  Duration backoff = std::chrono::milliseconds(200);  // before the first one; doubles each time
  Duration backoff_max = std::chrono::seconds(10);
  Duration healthy_after = std::chrono::seconds(10);  // running this long forgets earlier restarts
  Duration silent_after = std::chrono::seconds(5);    // no heartbeat for this long counts as hung; 0: never
};

}  // namespace adit
