// Runs actions when they are due, in order of their due times, on one thread.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <thread>

namespace adit::fault {

// Thread-safe. The thread starts with the first action; the destructor drops what is not due yet.
class DelayThread {
 public:
  using Instant = std::chrono::steady_clock::time_point;

  DelayThread() = default;
  ~DelayThread();
  void at(Instant due, std::function<void()> action);

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable wake_;
  std::multimap<Instant, std::function<void()>> actions_;  // equal times stay in order of insertion
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace adit::fault
