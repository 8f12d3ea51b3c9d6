#include "middleware/cyclonedds/deadline_timer.hpp"

#include <dds/ddsrt/time.h>

#include <cassert>
#include <cstddef>

namespace adit::cyclonedds {

DeadlineTimer::DeadlineTimer(const ddsi_domaingv* domain, Duration period, std::mutex& mutex,
                             std::function<void()> missed)
    : mutex_(mutex), missed_(std::move(missed)) {
  administration_.owner = this;
  deadline_init(domain, &administration_.timer, offsetof(Administration, timer), offsetof(Administration, instance),
                &DeadlineTimer::on_timer);
  administration_.timer.dur = period.count();
}

DeadlineTimer::~DeadlineTimer() {
  deadline_stop(&administration_.timer);
  deadline_clear(&administration_.timer);
  deadline_fini(&administration_.timer);
}

void DeadlineTimer::restart() {
  if (running_) {
    deadline_renew_instance_locked(&administration_.timer, &administration_.instance);
  } else {
    deadline_register_instance_locked(&administration_.timer, &administration_.instance, ddsrt_time_monotonic());
    running_ = true;
  }
}

void DeadlineTimer::pause() {
  if (!running_) return;
  deadline_unregister_instance_locked(&administration_.timer, &administration_.instance);
  running_ = false;
}

ddsrt_mtime_t DeadlineTimer::on_timer(void* administration, ddsrt_mtime_t now) {
  DeadlineTimer& self = *static_cast<Administration*>(administration)->owner;
  std::unique_lock lock(self.mutex_);
  void* instance = nullptr;
  ddsrt_mtime_t next = deadline_next_missed_locked(&self.administration_.timer, now, &instance);
  while (next.v == 0) {  // an instance missed its deadline
    deadline_reregister_instance_locked(&self.administration_.timer, &self.administration_.instance, now);
    lock.unlock();
    self.missed_();
    lock.lock();
    now = ddsrt_time_monotonic();
    next = deadline_next_missed_locked(&self.administration_.timer, now, &instance);
  }
  return next;
}

}  // namespace adit::cyclonedds
