#include "middleware/fault/fault_line.hpp"

#include <atomic>
#include <cstring>

namespace adit::fault {
namespace {

constexpr std::size_t header_bytes = 4;

struct OwnedBytes {
  std::atomic<std::uint32_t> references{1};
  std::vector<std::byte> bytes;
};

constexpr KeepAliveOperations owned_bytes_operations = {
    [](void* handle) noexcept { static_cast<OwnedBytes*>(handle)->references.fetch_add(1, std::memory_order_relaxed); },
    [](void* handle) noexcept {
      auto* owned = static_cast<OwnedBytes*>(handle);
      if (owned->references.fetch_sub(1, std::memory_order_acq_rel) == 1) delete owned;
    }};

Sample make_sample(std::vector<std::byte> bytes, const MessageInfo& info) {
  auto* owned = new OwnedBytes;
  owned->bytes = std::move(bytes);
  return Sample(owned->bytes, info, KeepAlive(&owned_bytes_operations, owned));
}

}  // namespace

Sample make_sample(Bytes bytes, const MessageInfo& info) {
  return make_sample(std::vector<std::byte>(bytes.begin(), bytes.end()), info);
}

FaultLine::FaultLine(std::vector<FaultRule> rules, std::uint64_t seed, DelayThread::Instant start,
                     std::weak_ptr<DelayThread> delays, Deliver deliver)
    : rules_(std::move(rules)),
      start_(start),
      delays_(std::move(delays)),
      random_(seed),
      deliver_(std::move(deliver)) {}

FaultLine::Draws FaultLine::draw() {
  const auto uniform = [this] { return static_cast<double>(random_() >> 11) * 0x1p-53; };
  Draws draws{};
  draws.drop = uniform();
  draws.truncate = uniform();
  draws.corrupt = uniform();
  draws.duplicate = uniform();
  draws.jitter = uniform();
  draws.reorder = uniform();
  draws.place = random_();
  return draws;
}

bool FaultLine::damage(const FaultRule& rule, const Draws& draws, Sample& sample) {
  const auto elapsed = std::chrono::steady_clock::now() - start_;
  if (elapsed >= rule.mute_after && elapsed < rule.mute_after + rule.mute_for) {
    ++counters_.muted;
    return false;
  }
  if (draws.drop < rule.drop || (rule.drop_every > 0 && index_ % rule.drop_every == 0)) {
    ++counters_.dropped;
    return false;
  }
  const std::size_t size = sample.bytes().size();
  if (size <= header_bytes) return true;
  std::mt19937_64 place(draws.place);
  const bool truncate = draws.truncate < rule.truncate;
  const bool corrupt = draws.corrupt < rule.corrupt;
  if (!truncate && !corrupt) return true;

  std::vector<std::byte> bytes(sample.bytes().begin(), sample.bytes().end());
  if (truncate) {
    bytes.resize(header_bytes + place() % (size - header_bytes));
    ++counters_.truncated;
  }
  if (corrupt && bytes.size() > header_bytes) {
    for (std::uint32_t i = 0; i < rule.corrupt_bits; ++i) {
      const std::uint64_t bit = place() % ((bytes.size() - header_bytes) * 8);
      bytes[header_bytes + bit / 8] ^= std::byte{1} << (bit % 8);
    }
    ++counters_.corrupted;
  }
  sample = make_sample(std::move(bytes), sample.info());
  return true;
}

void FaultLine::process(Sample sample) {
  Duration delay{}, hold{};
  bool twice = false;
  bool reorder = false;
  {
    const std::lock_guard lock(mutex_);
    ++index_;
    ++counters_.samples;
    bool alive = !muted_;
    if (muted_) ++counters_.muted;
    for (const auto& rule : rules_) {
      const Draws draws = draw();  // also for a sample that is gone: the next one's chances stay the same
      if (!alive) continue;
      alive = damage(rule, draws, sample);
      if (!alive) continue;
      if (draws.duplicate < rule.duplicate) twice = true;
      delay += rule.delay + std::chrono::duration_cast<Duration>(rule.jitter * draws.jitter);
      if (draws.reorder < rule.reorder) {
        reorder = true;
        hold = std::max(hold, rule.reorder_hold);
      }
    }
    if (!alive) return;
    if (twice) ++counters_.duplicated;
    if (delay > Duration::zero()) ++counters_.delayed;
    if (reorder && !held_) {
      ++counters_.reordered;
      held_ = std::move(sample);
      const std::uint64_t number = ++held_number_;
      const auto delays = delays_.lock();
      if (!delays) return;
      delays->at(std::chrono::steady_clock::now() + delay + hold, [line = weak_from_this(), number] {
        const auto self = line.lock();
        if (!self) return;
        const std::lock_guard deliver_lock(self->deliver_mutex_);
        std::optional<Sample> late;
        {
          const std::lock_guard inner(self->mutex_);
          if (self->held_ && self->held_number_ == number) late = std::exchange(self->held_, std::nullopt);
        }
        if (late && self->deliver_) self->deliver_(std::move(*late));
      });
      return;
    }
  }
  Sample copy;
  if (twice) copy = Sample(sample.bytes(), sample.info(), sample.memory());
  if (delay > Duration::zero()) {
    deliver_later(std::move(sample), delay);
    if (twice) deliver_later(std::move(copy), delay);
  } else {
    pass(std::move(sample));
    if (twice) pass(std::move(copy));
  }
}

void FaultLine::deliver_later(Sample sample, Duration delay) {
  const auto delays = delays_.lock();
  if (!delays) return;
  delays->at(std::chrono::steady_clock::now() + delay,
             [line = weak_from_this(), late = std::make_shared<Sample>(std::move(sample))] {
               if (const auto self = line.lock()) self->pass(std::move(*late));
             });
}

void FaultLine::pass(Sample sample) {
  const std::lock_guard deliver_lock(deliver_mutex_);
  std::optional<Sample> behind;
  {
    const std::lock_guard lock(mutex_);
    behind = std::exchange(held_, std::nullopt);
  }
  if (!deliver_) return;
  deliver_(std::move(sample));
  if (behind) deliver_(std::move(*behind));
}

void FaultLine::mute(bool on) {
  const std::lock_guard lock(mutex_);
  muted_ = on;
}

FaultCounters FaultLine::counters() const {
  const std::lock_guard lock(mutex_);
  return counters_;
}

void FaultLine::close() {
  const std::lock_guard deliver_lock(deliver_mutex_);
  deliver_ = nullptr;
  const std::lock_guard lock(mutex_);
  held_.reset();
}

}  // namespace adit::fault
