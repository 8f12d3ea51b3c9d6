// Says on stderr how far a run is: a bar on a terminal, else a line every tenth.
#pragma once

#include <chrono>
#include <string>

#include "middleware/time.hpp"

namespace adit::offline {

class Progress {
 public:
  Progress(std::string label, Time begin, Time end);
  void at(Time now);
  void done() const;

 private:
  using Steady = std::chrono::steady_clock;
  std::string label_;
  Time begin_;
  Duration whole_;
  Steady::time_point start_ = Steady::now();
  bool terminal_;
  int shown_ = 0;
};

}  // namespace adit::offline
