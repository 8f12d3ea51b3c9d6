// The last samples of a stream, oldest first: what interpolation between sensors reads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace adit {

// `Sample` has a `stamp_ns`. Whether a sample fits (sane, later than the newest) is for the owner to judge before the
// push. No allocation after construction.
template <class Sample>
class StampedRing {
 public:
  explicit StampedRing(std::size_t capacity) : samples_(capacity) {}

  // The oldest one makes room.
  void push(const Sample& sample) {
    if (count_ == samples_.size()) {
      first_ = (first_ + 1) % samples_.size();
      --count_;
    }
    samples_[(first_ + count_) % samples_.size()] = sample;
    ++count_;
  }
  void clear() { first_ = count_ = 0; }

  std::size_t size() const { return count_; }
  bool empty() const { return count_ == 0; }
  const Sample& operator[](std::size_t i) const { return samples_[(first_ + i) % samples_.size()]; }
  const Sample& newest() const { return (*this)[count_ - 1]; }

  // Whether the first `used` samples reach over the interval, up to `max_beyond_s` at its ends, without a gap in it of
  // more than `max_gap_s`. Stamps rise.
  bool covers(std::int64_t from_ns, std::int64_t to_ns, std::size_t used, double max_beyond_s, double max_gap_s) const {
    const auto seconds = [](std::int64_t from, std::int64_t to) { return 1e-9 * static_cast<double>(to - from); };
    const StampedRing& at = *this;
    if (used == 0 || seconds(from_ns, at[0].stamp_ns) > max_beyond_s ||
        seconds(at[used - 1].stamp_ns, to_ns) > max_beyond_s) {
      return false;
    }
    for (std::size_t i = used - 1; i > 0 && at[i].stamp_ns > from_ns; --i) {
      const bool within = at[i - 1].stamp_ns < to_ns;
      if (within && seconds(at[i - 1].stamp_ns, at[i].stamp_ns) > max_gap_s) return false;
    }
    return true;
  }

 private:
  std::vector<Sample> samples_;
  std::size_t first_ = 0, count_ = 0;
};

}  // namespace adit
