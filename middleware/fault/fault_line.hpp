// What a plan's rules do to the samples of one endpoint.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <random>

#include "middleware/fault/delay_thread.hpp"
#include "middleware/fault/fault_plan.hpp"
#include "middleware/sample.hpp"

namespace adit::fault {

// A sample with memory of its own.
Sample make_sample(Bytes bytes, const MessageInfo& info);

// Samples go in with process() and come out through `deliver`: at once on the same thread, or later on the delay
// thread. Thread-safe; `deliver` is never called concurrently, nor after close(). It must not call back into the line.
class FaultLine : public std::enable_shared_from_this<FaultLine> {
 public:
  using Deliver = std::function<void(Sample)>;

  // `rules` are those of this endpoint; `start` is when the plan began.
  FaultLine(std::vector<FaultRule> rules, std::uint64_t seed, DelayThread::Instant start,
            std::weak_ptr<DelayThread> delays, Deliver deliver);

  void process(Sample sample);
  void mute(bool on);
  FaultCounters counters() const;
  // Drops what is delayed. When it returns, `deliver` is not running and will not be called again.
  void close();

 private:
  // All that chance decides about one sample under one rule: always the same number of draws, so that switching one
  // fault on does not change what the others do.
  struct Draws {
    double drop, truncate, corrupt, duplicate, jitter, reorder;
    std::uint64_t place;  // seeds where to cut and which bits to flip
  };
  Draws draw();
  // The sample's fate up to the delay; false: it is gone.
  bool damage(const FaultRule& rule, const Draws& draws, Sample& sample);
  void deliver_later(Sample sample, Duration delay);
  void pass(Sample sample);  // deliver, and behind it what was held back

  const std::vector<FaultRule> rules_;
  const DelayThread::Instant start_;
  const std::weak_ptr<DelayThread> delays_;  // the participant's: gone with it

  mutable std::mutex mutex_;
  std::mt19937_64 random_;
  std::uint64_t index_ = 0;
  FaultCounters counters_;
  bool muted_ = false;
  std::optional<Sample> held_;
  std::uint64_t held_number_ = 0;

  std::mutex deliver_mutex_;  // held while delivering; taken before mutex_, never after it
  Deliver deliver_;
};

}  // namespace adit::fault
