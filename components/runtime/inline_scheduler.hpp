#pragma once

#include "components/runtime/scheduler.hpp"

namespace adit {

// Runs strands on the caller's thread, in the order they became ready: deterministic. Not thread-safe. Alarms are
// ignored: whoever owns the simulated time fires timers (OfflineRunner).
class InlineScheduler final : public Scheduler {
 public:
  void add(Strand& strand) override { attached(strand) = true; }
  void remove(Strand& strand) override;
  void schedule(Strand& strand) override;
  void set_alarm(Strand&, SteadyTime) override {}
  bool would_starve_if_caller_waits() const override { return true; }

  // Runs until no strand has work left.
  void run_until_idle();

 private:
  Queue ready_;
};

}  // namespace adit
