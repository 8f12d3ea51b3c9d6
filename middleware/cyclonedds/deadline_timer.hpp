// Tells when a reader with a deadline got nothing for that long. A thread of its own, because Cyclone's timers are in
// headers that do not compile as C++; only readers with a deadline have one.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include "middleware/time.hpp"

namespace adit::cyclonedds {

class DeadlineTimer {
 public:
  // `missed` is called on the timer's thread, once per period in which nothing was seen.
  DeadlineTimer(Duration period, std::function<void()> missed);
  // Waits for a running `missed`.
  ~DeadlineTimer();
  DeadlineTimer(const DeadlineTimer&) = delete;
  DeadlineTimer& operator=(const DeadlineTimer&) = delete;

  // A sample arrived: the period starts anew. The first one starts the timer.
  void restart();
  // Nobody writes any more.
  void pause();

 private:
  using Clock = std::chrono::steady_clock;
  void run();

  const Duration period_;
  const std::function<void()> missed_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Clock::time_point> due_;  // none: paused
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace adit::cyclonedds
