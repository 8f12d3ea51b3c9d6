#include "components/runtime/input.hpp"

#include "components/runtime/component.hpp"
#include "components/runtime/component_core.hpp"
#include "components/runtime/local_bus.hpp"
#include "middleware/participant.hpp"

namespace adit {

// Messages a component may hold on to before the pool has to build more.
constexpr std::size_t spare_messages = 4;

InputBase::InputBase(Component& owner, std::string name, const ErasedType& type, const Qos& qos, const Queue& queue,
                     ErasedHandler handler)
    : core_(owner.core()), name_(std::move(name)), type_(type), qos_(qos), handler_(std::move(handler)), queue_(queue) {
  core_.add(*this);
}

InputBase::~InputBase() {
  stop();
  close();
  core_.remove(*this);
}

PortInfo InputBase::info() const {
  return {PortInfo::Direction::input, core_.full_name(), name_, topic_name_, type_.info, qos_, queue_};
}

InputStats InputBase::stats() const {
  InputStats stats;
  stats.handled = handled_;
  stats.refused = refused_;
  stats.last_refusal = last_refusal_.load();
  {
    const std::lock_guard lock(core_.queue_mutex());
    stats.dropped = dropped_;
    stats.waiting = count_;
  }
  const std::lock_guard lock(endpoint_mutex_);
  if (pool_) stats.pool_misses = pool_->misses();
  if (reader_) stats.link = reader_->stats();
  return stats;
}

// --- Lifecycle ---

void InputBase::bind(std::string topic, const Queue& queue, Qos::Reliability reliability) {
  topic_name_ = std::move(topic);
  queue_ = queue;
  qos_.reliability = reliability;
}

Result<void> InputBase::open(Participant* participant, LocalBus& bus) {
  unbounded_ = core_.environment().offline;
  ring_ = std::vector<Waiting>(queue_.size);
  const std::lock_guard lock(endpoint_mutex_);
  topic_ = &bus.topic(topic_name_);
  pool_.emplace(type_, queue_.size + spare_messages);
  if (!participant) return {};
  EndpointConfig config;
  config.topic = topic_name_;
  config.type = type_.info;
  config.qos = qos_;
  // The strand empties the reader only between handlers: it has to hold what the queue is meant to hold.
  if (config.qos.depth != 0) config.qos.depth = std::max(config.qos.depth, static_cast<std::uint32_t>(queue_.size));
  config.node = core_.full_name();
  config.ignore_local = true;
  auto reader = participant->reader(config);
  if (!reader) return reader.error();
  reader_ = std::move(*reader);
  return {};
}

void InputBase::start() {
  discard_unread();
  {
    const std::lock_guard lock(core_.queue_mutex());
    accepting_ = true;
  }
  topic_->attach(*this);
  if (!reader_) return;
  reader_->on_data([this] {
    if (!reader_ready_.exchange(true)) core_.wake();
  });
}

void InputBase::stop() {
  {
    const std::lock_guard lock(core_.queue_mutex());
    if (!accepting_) return;
    accepting_ = false;
  }
  space_.notify_all();
  topic_->detach(*this);
  if (reader_) reader_->on_data(nullptr);
  reader_ready_ = false;
  const std::lock_guard lock(core_.queue_mutex());
  while (count_ > 0) pop();
}

void InputBase::close() {
  const std::lock_guard lock(endpoint_mutex_);
  reader_.reset();
  pool_.reset();
}

// What arrived while the component was not active is history, unless history is what it asked for.
void InputBase::discard_unread() {
  if (!reader_ || qos_.durability == Qos::Durability::transient_local) return;
  while (const std::size_t n = reader_->take(taken_)) {
    for (std::size_t i = 0; i < n; ++i) taken_[i].reset();
  }
}

// --- Arrival ---

void InputBase::offer(const std::shared_ptr<const void>& message, const MessageInfo& info, Duration max_blocking) {
  Waiting dropped;  // destroyed without the lock
  {
    std::unique_lock lock(core_.queue_mutex());
    if (queue_.when_full == WhenFull::block && full() && accepting_ &&
        !core_.environment().scheduler->would_starve_if_caller_waits()) {
      space_.wait_for(lock, max_blocking, [this] { return !full() || !accepting_; });
    }
    if (!accepting_ || !admit({message, {}, info}, dropped)) return;
  }
  core_.wake();
}

void InputBase::offer(Sample sample) {
  Waiting dropped;
  {
    const std::lock_guard lock(core_.queue_mutex());
    const MessageInfo info = sample.info();
    if (!accepting_ || !admit({nullptr, std::move(sample), info}, dropped)) return;
  }
  core_.wake();
}

// False when the new message was the one to go.
bool InputBase::admit(Waiting&& waiting, Waiting& dropped) {
  if (full()) {
    ++dropped_;
    if (queue_.when_full != WhenFull::drop_oldest) {
      dropped = std::move(waiting);
      return false;
    }
    dropped = pop();
  }
  push(std::move(waiting));
  return true;
}

void InputBase::push(Waiting&& waiting) {
  if (count_ == ring_.size()) {  // offline only
    std::vector<Waiting> larger(2 * ring_.size());
    for (std::size_t i = 0; i < count_; ++i) larger[i] = std::move(ring_[(first_ + i) % ring_.size()]);
    ring_ = std::move(larger);
    first_ = 0;
  }
  waiting.order = core_.next_order();
  ring_[(first_ + count_++) % ring_.size()] = std::move(waiting);
}

InputBase::Waiting InputBase::pop() {
  Waiting waiting = std::move(ring_[first_]);
  first_ = (first_ + 1) % ring_.size();
  --count_;
  return waiting;
}

// --- In the strand ---

void InputBase::drain_reader() {
  if (!reader_ || !reader_ready_.exchange(false)) return;
  while (true) {
    std::size_t room = taken_.size();
    if (queue_.when_full == WhenFull::block) {
      // What does not fit stays with the middleware, whose own flow control then holds the writer back.
      const std::lock_guard lock(core_.queue_mutex());
      room = std::min(room, ring_.size() - count_);
      if (room == 0) {
        reader_ready_ = true;
        return;
      }
    }
    const std::size_t taken = reader_->take({taken_.data(), room});
    if (taken == 0) return;
    for (std::size_t i = 0; i < taken; ++i) {
      Waiting dropped;
      const MessageInfo info = taken_[i].info();
      const std::lock_guard lock(core_.queue_mutex());
      admit({nullptr, std::move(taken_[i]), info}, dropped);
    }
  }
}

std::optional<std::uint64_t> InputBase::next_order() const {
  if (count_ == 0) return {};
  return ring_[first_].order;
}

void InputBase::handle_next() {
  Waiting next;
  {
    const std::lock_guard lock(core_.queue_mutex());
    if (count_ == 0) return;
    next = pop();
  }
  if (queue_.when_full == WhenFull::block) space_.notify_one();
  if (!next.message) {
    std::shared_ptr<void> message = pool_->acquire();
    const char* const refusal = type_.decode(next.sample.bytes(), next.sample.memory(), message.get());
    next.sample.reset();
    if (refusal) {
      last_refusal_ = refusal;
      refused_.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    next.message = std::move(message);
  }
  handled_.fetch_add(1, std::memory_order_relaxed);
  handler_(next.message, next.info);
}

}  // namespace adit
