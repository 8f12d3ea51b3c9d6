#include "components/runtime/timer.hpp"

#include <algorithm>

#include "components/runtime/component.hpp"
#include "components/runtime/component_core.hpp"

namespace adit {

Timer::Timer(Prepared, Component& owner, std::string name, Duration period, Handler handler)
    : core_(owner.core()),
      name_(std::move(name)),
      handler_(std::move(handler)),
      period_(std::max(period, Duration(1))) {
  core_.add(*this);
}

Timer::~Timer() {
  core_.remove(*this);
}

void Timer::set_period(Duration period) {
  period_ = std::max(period, Duration(1));
  if (next_ != never) arm(core_.timer_now());
}

TimerStats Timer::stats() const {
  return {name_, fired_, missed_};
}

void Timer::arm(Duration::rep now) {
  next_ = now + period_.count();
}

void Timer::fire(Duration::rep now, Time clock_now) {
  const Duration::rep late = now - next_;
  const auto missed = static_cast<std::uint64_t>(late / period_.count());
  const Time scheduled = clock_now - Duration(late % period_.count());
  next_ += static_cast<Duration::rep>(missed + 1) * period_.count();
  fired_.fetch_add(1, std::memory_order_relaxed);
  missed_.fetch_add(missed, std::memory_order_relaxed);
  handler_({scheduled, clock_now, missed});
}

}  // namespace adit
