// Figures of a stream of samples over a sliding window, for `adit topic hz|bw|delay`.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <string>

#include "middleware/time.hpp"

namespace adit {

class RateMeter {
 public:
  explicit RateMeter(std::size_t window) : window_(window) {}

  // `delay`: arrival minus the message's own stamp, where it has one.
  void add(Time arrival, std::size_t bytes, std::optional<Duration> delay);

  std::size_t samples() const { return entries_.size(); }
  // "average rate 10.000 Hz  interval min 0.099 s max 0.101 s std 0.0003 s  window 100"; what is missing is said.
  std::string rate() const;
  // "41.9 MB/s  mean 4.19 MB  min 4.19 MB  max 4.19 MB  window 100"
  std::string bandwidth() const;
  // "delay mean 1.2 ms  min 0.9 ms  max 3.0 ms  std 0.2 ms  window 100"
  std::string delay() const;

 private:
  struct Entry {
    Time arrival;
    std::size_t bytes;
    std::optional<Duration> delay;
  };
  std::size_t window_;
  std::deque<Entry> entries_;
};

}  // namespace adit
