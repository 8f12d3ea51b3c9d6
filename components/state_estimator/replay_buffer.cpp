#include "components/state_estimator/replay_buffer.hpp"

#include <algorithm>

namespace adit::state_estimator {

ReplayBuffer::ReplayBuffer(const Filter& filter, const ReplayConfig& config) : filter_(filter), config_(config) {
  config_.capacity = std::max<std::size_t>(config_.capacity, 16);
  config_.checkpoints = std::max<std::size_t>(config_.checkpoints, 4);
  config_.events_per_checkpoint = std::max<std::size_t>(config_.events_per_checkpoint, 1);
  events_.reserve(2 * config_.capacity);
  checkpoints_.resize(config_.checkpoints);
  restart(FilterState{});
}

void ReplayBuffer::restart(const FilterState& state) {
  events_.clear();
  first_event_ = 0;
  first_serial_ = 0;
  first_checkpoint_ = 0;
  checkpoint_count_ = 0;
  head_ = state;
  save_checkpoint(0);
}

ReplayBuffer::Outcome ReplayBuffer::insert(const Measurement& event) {
  const Checkpoint& base = checkpoints_[first_checkpoint_];
  const bool consumed = base.next_event > 0;
  if (event.stamp_ns < base.state.stamp_ns || (consumed && event.stamp_ns == base.state.stamp_ns)) {
    return Outcome::too_old;
  }
  compact();
  const auto begin = events_.begin() + static_cast<std::ptrdiff_t>(first_event_);
  const auto place = std::upper_bound(begin, events_.end(), event, processed_before);
  const auto twin = [&](const Measurement& other) {
    return other.stamp_ns == event.stamp_ns && other.kind == event.kind && other.sensor == event.sensor;
  };
  if ((place != begin && twin(*std::prev(place))) || (place != events_.end() && twin(*place))) {
    return Outcome::duplicate;
  }
  const std::size_t index = static_cast<std::size_t>(place - events_.begin());
  events_.insert(place, event);
  if (index + 1 == events_.size()) {
    filter_.apply(head_, event);
    save_checkpoint(index + 1);
    forget_old();
    return Outcome::applied;
  }
  run_from(index);
  forget_old();
  return Outcome::replayed;
}

void ReplayBuffer::run_from(std::size_t event_index) {
  const auto newest = [&]() -> const Checkpoint& {
    return checkpoints_[(first_checkpoint_ + checkpoint_count_ - 1) % checkpoints_.size()];
  };
  while (newest().next_event > serial(event_index)) --checkpoint_count_;
  head_ = newest().state;
  const std::size_t start = first_event_ + static_cast<std::size_t>(newest().next_event - first_serial_);
  for (std::size_t i = start; i < events_.size(); ++i) {
    filter_.apply(head_, events_[i]);
    save_checkpoint(i + 1);
  }
}

void ReplayBuffer::save_checkpoint(std::size_t next_event_index) {
  const std::uint64_t next = serial(next_event_index);
  if (checkpoint_count_ > 0) {
    const Checkpoint& last = checkpoints_[(first_checkpoint_ + checkpoint_count_ - 1) % checkpoints_.size()];
    if (next - last.next_event < config_.events_per_checkpoint) return;
  }
  if (checkpoint_count_ == checkpoints_.size()) {
    first_checkpoint_ = (first_checkpoint_ + 1) % checkpoints_.size();
    --checkpoint_count_;
  }
  Checkpoint& slot = checkpoints_[(first_checkpoint_ + checkpoint_count_) % checkpoints_.size()];
  slot.state = head_;
  slot.next_event = next;
  ++checkpoint_count_;
}

void ReplayBuffer::forget_old() {
  const std::int64_t keep_from = head_.stamp_ns - static_cast<std::int64_t>(config_.history_s * 1e9);
  while (checkpoint_count_ >= 2) {
    const Checkpoint& second = checkpoints_[(first_checkpoint_ + 1) % checkpoints_.size()];
    const bool full = event_count() >= config_.capacity;
    if (second.state.stamp_ns > keep_from && !full) break;
    first_checkpoint_ = (first_checkpoint_ + 1) % checkpoints_.size();
    --checkpoint_count_;
    const std::uint64_t next = checkpoints_[first_checkpoint_].next_event;
    first_event_ += static_cast<std::size_t>(next - first_serial_);
    first_serial_ = next;
  }
  // A ring that wrapped during a replay may have moved the oldest checkpoint.
  const std::uint64_t next = checkpoints_[first_checkpoint_].next_event;
  first_event_ += static_cast<std::size_t>(next - first_serial_);
  first_serial_ = next;
}

// Moves the living events to the front when the reserved room is used up, so that insertion never allocates.
void ReplayBuffer::compact() {
  if (events_.size() < events_.capacity()) return;
  events_.erase(events_.begin(), events_.begin() + static_cast<std::ptrdiff_t>(first_event_));
  first_event_ = 0;
}

std::optional<FilterState> ReplayBuffer::state_at(std::int64_t stamp_ns) const {
  if (stamp_ns < horizon_ns()) return std::nullopt;
  FilterState state;
  if (stamp_ns >= head_.stamp_ns) {
    state = head_;
  } else {
    std::size_t k = checkpoint_count_ - 1;
    const auto at = [&](std::size_t i) -> const Checkpoint& {
      return checkpoints_[(first_checkpoint_ + i) % checkpoints_.size()];
    };
    while (at(k).state.stamp_ns > stamp_ns) --k;
    state = at(k).state;
    for (std::size_t i = first_event_ + static_cast<std::size_t>(at(k).next_event - first_serial_);
         i < events_.size() && events_[i].stamp_ns <= stamp_ns; ++i) {
      filter_.apply(state, events_[i]);
    }
  }
  predict(state, stamp_ns, filter_.process);
  return state;
}

bool ReplayBuffer::has_anchor(std::uint8_t sensor, std::int64_t stamp_ns) const {
  const SensorModel& model = filter_.sensor(sensor);
  for (std::size_t i = events_.size(); i-- > first_event_;) {
    const Measurement& e = events_[i];
    if (e.stamp_ns < stamp_ns) break;
    if (e.stamp_ns == stamp_ns && e.sensor == sensor && (e.kind == Measurement::Kind::clone || model.reanchor)) {
      return true;
    }
  }
  const FilterState& base = checkpoints_[first_checkpoint_].state;
  return base.clone_stamp_ns[static_cast<std::size_t>(model.clone_slot)] == stamp_ns;
}

std::span<const Measurement> ReplayBuffer::events(std::int64_t from_ns, std::int64_t to_ns) const {
  const auto later = [](std::int64_t stamp, const Measurement& e) { return stamp < e.stamp_ns; };
  const auto begin = events_.begin() + static_cast<std::ptrdiff_t>(first_event_);
  const auto first = std::upper_bound(begin, events_.end(), from_ns, later);
  const auto last = std::upper_bound(first, events_.end(), to_ns, later);
  return {first, last};
}

}  // namespace adit::state_estimator
