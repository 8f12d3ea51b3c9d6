#include "middleware/fault/delay_thread.hpp"

namespace adit::fault {

DelayThread::~DelayThread() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void DelayThread::at(Instant due, std::function<void()> action) {
  {
    const std::lock_guard lock(mutex_);
    if (!thread_.joinable()) thread_ = std::thread(&DelayThread::run, this);
    actions_.emplace(due, std::move(action));
  }
  wake_.notify_all();
}

void DelayThread::run() {
  std::unique_lock lock(mutex_);
  while (!stop_) {
    if (actions_.empty()) {
      wake_.wait(lock);
      continue;
    }
    const auto first = actions_.begin();
    if (const Instant due = first->first; due > std::chrono::steady_clock::now()) {
      wake_.wait_until(lock, due);
      continue;
    }
    const auto action = std::move(first->second);
    actions_.erase(first);
    lock.unlock();
    action();
    lock.lock();
  }
}

}  // namespace adit::fault
