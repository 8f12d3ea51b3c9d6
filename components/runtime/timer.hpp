// Periodic work of a component.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <type_traits>

#include "components/runtime/scheduler.hpp"
#include "middleware/time.hpp"

namespace adit {

class Clock;
class Component;
class ComponentCore;

struct TimerTick {
  Time scheduled{};          // when it was due
  Time now{};                // when the handler was called
  std::uint64_t missed = 0;  // ticks skipped since the last call because the component or the machine was busy
};

struct TimerStats {
  std::string name;
  std::uint64_t fired = 0;
  std::uint64_t missed = 0;
};

// Calls `handler` every `period` of the component's clock while the component is active, first one period after
// activation. The schedule is activation + n * period: it does not drift. Ticks that come too late are skipped and
// counted. With simulated time it fires when the clock passes the tick, and starts over when time jumps back.
class Timer {
 public:
  using Handler = std::function<void(const TimerTick&)>;

  template <class F>
  Timer(Component& owner, std::string name, Duration period, F handler)
      : Timer(Prepared{}, owner, std::move(name), period, adapt(std::move(handler))) {}
  ~Timer();
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;

  // In configure(), or in a handler of the component: the next tick is one new period from now. Positive.
  void set_period(Duration period);
  Duration period() const { return period_; }
  TimerStats stats() const;

 private:
  friend class ComponentCore;
  struct Prepared {};
  Timer(Prepared, Component& owner, std::string name, Duration period, Handler handler);

  template <class F>
  static Handler adapt(F handler) {
    if constexpr (std::is_invocable_v<F&>) {
      return [handler = std::move(handler)](const TimerTick&) mutable { handler(); };
    } else {
      return handler;
    }
  }

  // Times are nanoseconds of the steady clock, or of the simulated one.
  void arm(Duration::rep now);
  void disarm() { next_ = never; }
  bool due(Duration::rep now) const { return next_ <= now; }
  void fire(Duration::rep now, Time clock_now);

  static constexpr Duration::rep never = std::numeric_limits<Duration::rep>::max();
  ComponentCore& core_;
  const std::string name_;
  const Handler handler_;
  Duration period_;
  Duration::rep next_ = never;
  std::atomic<std::uint64_t> fired_{0};
  std::atomic<std::uint64_t> missed_{0};
};

}  // namespace adit
