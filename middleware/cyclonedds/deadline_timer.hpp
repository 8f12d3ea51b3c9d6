// Tells when a reader with a deadline got nothing for that long: Cyclone's own deadline timer, for one instance.
#pragma once

#include <dds/ddsi/ddsi_deadline.h>

#include <functional>
#include <mutex>

#include "middleware/time.hpp"

namespace adit::cyclonedds {

class DeadlineTimer {
 public:
  // `missed` is called on Cyclone's timer thread, without `mutex`, once per period in which nothing was seen.
  DeadlineTimer(const ddsi_domaingv* domain, Duration period, std::mutex& mutex, std::function<void()> missed);
  // Waits for a running `missed`; call it without the mutex.
  ~DeadlineTimer();
  DeadlineTimer(const DeadlineTimer&) = delete;
  DeadlineTimer& operator=(const DeadlineTimer&) = delete;

  // A sample arrived: the period starts anew (the first one starts the timer). With the mutex held.
  void restart();
  // Nobody writes any more. With the mutex held.
  void pause();

 private:
  // What Cyclone's timer administration points into.
  struct Administration {
    deadline_adm timer;
    deadline_elem instance;
    DeadlineTimer* owner;
  };
  static ddsrt_mtime_t on_timer(void* administration, ddsrt_mtime_t now);

  std::mutex& mutex_;
  const std::function<void()> missed_;
  Administration administration_{};
  bool running_ = false;
};

}  // namespace adit::cyclonedds
