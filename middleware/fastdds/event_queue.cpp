#include "middleware/fastdds/event_queue.hpp"

namespace adit::fastdds {

EventQueue::~EventQueue() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  if (!thread_.joinable()) return;
  if (thread_.get_id() == std::this_thread::get_id()) {
    thread_.detach();
  } else {
    thread_.join();
  }
}

void EventQueue::post(Event event) {
  {
    const std::lock_guard lock(mutex_);
    if (!handler_) return;
    waiting_.push_back(std::move(event));
  }
  wake_.notify_one();
}

void EventQueue::set_handler(EventHandler handler) {
  std::unique_lock lock(mutex_);
  handler_ = std::move(handler);
  if (!handler_) waiting_.clear();
  if (!thread_.joinable()) {
    if (handler_) thread_ = std::thread(&EventQueue::run, this);
    return;
  }
  if (thread_.get_id() != std::this_thread::get_id()) idle_.wait(lock, [this] { return !running_handler_; });
}

void EventQueue::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    wake_.wait(lock, [this] { return stop_ || !waiting_.empty(); });
    if (stop_) return;
    const Event event = std::move(waiting_.front());
    waiting_.pop_front();
    const EventHandler handler = handler_;
    if (!handler) continue;
    running_handler_ = true;
    lock.unlock();
    handler(event);
    lock.lock();
    running_handler_ = false;
    idle_.notify_all();
  }
}

}  // namespace adit::fastdds
