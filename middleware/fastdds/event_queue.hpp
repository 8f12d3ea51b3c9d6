// Delivers events to the application on a thread of its own, so that no lock of the vendor is held meanwhile.
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include "middleware/graph.hpp"

namespace adit::fastdds {

// Thread-safe. The thread starts with the first handler; without a handler events are dropped, as nobody listens.
class EventQueue {
 public:
  EventQueue() = default;
  ~EventQueue();

  void post(Event event);
  // When it returns, the previous handler is not running and will not be called again (unless called from within it).
  void set_handler(EventHandler handler);

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable wake_, idle_;
  std::deque<Event> waiting_;
  EventHandler handler_;
  bool running_handler_ = false;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace adit::fastdds
