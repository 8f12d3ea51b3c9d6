// The time components live in: the system's, or a simulated one that /clock or the offline runner sets.
#pragma once

#include <atomic>

#include "middleware/time.hpp"

namespace adit {

// One a process. Reading is lock-free, any thread; set() is for whoever owns the simulated time.
class Clock {
 public:
  enum class Source { system, simulated };
  explicit Clock(Source source = Source::system) : source_(source) {}

  // Simulated time is the epoch until it is set for the first time.
  Time now() const { return simulated() ? Time(Duration(simulated_.load(std::memory_order_acquire))) : system_now(); }
  bool simulated() const { return source_ == Source::simulated; }

  struct Step {
    Duration by{};       // negative when time jumped back (a bag was started again)
    bool first = false;  // there was no time before
  };
  Step set(Time time) {
    const auto before = simulated_.exchange(time.time_since_epoch().count(), std::memory_order_acq_rel);
    return {Duration(time.time_since_epoch().count() - before), !was_set_.exchange(true)};
  }

 private:
  const Source source_;
  std::atomic<Duration::rep> simulated_{0};
  std::atomic<bool> was_set_{false};
};

}  // namespace adit
