#include "middleware/cyclonedds/deadline_timer.hpp"

namespace adit::cyclonedds {

DeadlineTimer::DeadlineTimer(Duration period, std::function<void()> missed)
    : period_(period), missed_(std::move(missed)), thread_([this] { run(); }) {}

DeadlineTimer::~DeadlineTimer() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

// A running timer is not woken: it finds the new time when the old one has come.
void DeadlineTimer::restart() {
  const std::lock_guard lock(mutex_);
  const bool was_paused = !due_;
  due_ = Clock::now() + period_;
  if (was_paused) changed_.notify_one();
}

void DeadlineTimer::pause() {
  const std::lock_guard lock(mutex_);
  due_.reset();
}

void DeadlineTimer::run() {
  std::unique_lock lock(mutex_);
  while (!stop_) {
    if (!due_) {
      changed_.wait(lock, [this] { return stop_ || due_; });
    } else if (const auto due = *due_; Clock::now() < due) {
      changed_.wait_until(lock, due, [this] { return stop_; });
    } else {
      *due_ += period_;
      lock.unlock();
      missed_();
      lock.lock();
    }
  }
}

}  // namespace adit::cyclonedds
