// Whether a stream's next stamp may be believed.
#pragma once

#include <cstdint>
#include <optional>

namespace adit {

// A stamp must be later than the last one taken. One that is not is refused, until a few in a row, each later than the
// one before, show that the clock was set back: by more than `step`, since less is what samples look like that overtake
// each other on the way.
class StampOrder {
 public:
  // run: refused stamps that show it, the last of them is taken; step [s].
  StampOrder(int run, double step) : run_(run), step_(step) {}

  // last_ns: the last stamp taken, if there is one. A stamp taken that is not later than it is of a clock set back.
  bool accepts(std::int64_t stamp_ns, std::optional<std::int64_t> last_ns) {
    if (!last_ns || stamp_ns > *last_ns) {
      refused_in_a_row_ = 0;
      return true;
    }
    if (1e-9 * static_cast<double>(*last_ns - stamp_ns) <= step_) return false;
    refused_in_a_row_ = refused_in_a_row_ > 0 && stamp_ns > refused_ns_ ? refused_in_a_row_ + 1 : 1;
    refused_ns_ = stamp_ns;
    if (refused_in_a_row_ < run_) return false;
    refused_in_a_row_ = 0;
    return true;
  }
  void clear() { refused_in_a_row_ = 0; }

 private:
  int run_;
  double step_;
  std::int64_t refused_ns_ = 0;  // the last one refused
  int refused_in_a_row_ = 0;
};

}  // namespace adit
