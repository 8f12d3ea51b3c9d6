// Measurements in the order of their own time, whatever order they arrive in: a late one restores the newest checkpoint
// before it and everything after is applied again. All memory is allocated at construction.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "components/state_estimator/filter.hpp"

namespace adit::state_estimator {

struct ReplayConfig {
  double history_s = 5.0;       // how late a measurement may be
  std::size_t capacity = 4096;  // events held; when full, the history gets shorter
  std::size_t events_per_checkpoint = 6;
  std::size_t checkpoints = 512;
};

class ReplayBuffer {
 public:
  enum class Outcome { applied, replayed, too_old, duplicate };

  // `filter` must outlive the buffer.
  ReplayBuffer(const Filter& filter, const ReplayConfig& config);

  // Forgets everything and starts from `state`, whose stamp bounds how old a measurement may be.
  void restart(const FilterState& state);

  // Adds an event and brings head() up to date. too_old and duplicate (same sensor, kind and stamp) change nothing.
  Outcome insert(const Measurement& event);

  // After the newest event.
  const FilterState& head() const { return head_; }
  // The state at an instant within the history or after the head (predicted); nothing before the history.
  std::optional<FilterState> state_at(std::int64_t stamp_ns) const;
  // Oldest instant a measurement may speak about.
  std::int64_t horizon_ns() const { return checkpoints_[first_checkpoint_].state.stamp_ns; }
  // True when processing will hold a clone of this instant for this sensor.
  bool has_anchor(std::uint8_t sensor, std::int64_t stamp_ns) const;
  // Events after `from_ns` up to `to_ns`, in order of processing.
  std::span<const Measurement> events(std::int64_t from_ns, std::int64_t to_ns) const;

 private:
  struct Checkpoint {
    FilterState state;
    std::uint64_t next_event = 0;  // serial number of the first event not yet in the state
  };
  std::size_t event_count() const { return events_.size() - first_event_; }
  std::uint64_t serial(std::size_t index) const { return first_serial_ + (index - first_event_); }
  void run_from(std::size_t event_index);
  void save_checkpoint(std::size_t next_event_index);
  void forget_old();
  void compact();

  const Filter& filter_;
  ReplayConfig config_;
  std::vector<Measurement> events_;  // [first_event_, end) are alive and sorted
  std::size_t first_event_ = 0;
  std::uint64_t first_serial_ = 0;
  std::vector<Checkpoint> checkpoints_;  // ring: first_checkpoint_, checkpoint_count_
  std::size_t first_checkpoint_ = 0, checkpoint_count_ = 0;
  FilterState head_;
};

}  // namespace adit::state_estimator
