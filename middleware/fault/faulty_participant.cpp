#include "middleware/fault/faulty_participant.hpp"

#include <atomic>
#include <deque>
#include <string_view>
#include <thread>

namespace adit {
namespace {

using fault::FaultLine;

bool covers(std::string_view pattern, std::string_view topic) {
  if (!pattern.ends_with('*')) return pattern == topic;
  pattern.remove_suffix(1);
  return topic.starts_with(pattern);
}

// FNV-1a: the same on every machine, unlike std::hash.
std::uint64_t hash(std::string_view text, std::uint64_t state) {
  for (const char c : text) state = (state ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return state;
}

class FaultyWriter final : public Writer {
 public:
  explicit FaultyWriter(std::shared_ptr<Writer> inner, std::shared_ptr<FaultLine> line)
      : inner_(std::move(inner)), line_(std::move(line)) {}
  ~FaultyWriter() override { line_->close(); }

  using Writer::forward;
  using Writer::publish;
  Result<void> publish(const Encoder& message, Time source_time) override {
    std::vector<std::byte> bytes(message.size());
    const std::size_t written = message.write(bytes);
    if (written == 0) return Error{ErrorCode::malformed, "'" + config().topic + "': the message cannot be encoded"};
    return forward(Bytes(bytes).first(written), source_time);
  }
  Result<void> forward(Bytes cdr, Time source_time) override {
    MessageInfo info;
    info.source_time = source_time;
    line_->process(fault::make_sample(cdr, info));
    return {};
  }
  bool has_remote_readers() const override { return inner_->has_remote_readers(); }
  Result<void> wait_for_acknowledgements(Duration timeout) override {
    return inner_->wait_for_acknowledgements(timeout);
  }
  LinkStats stats() const override { return inner_->stats(); }
  const EndpointConfig& config() const override { return inner_->config(); }
  Gid gid() const override { return inner_->gid(); }

 private:
  const std::shared_ptr<Writer> inner_;
  const std::shared_ptr<FaultLine> line_;
};

// Where a line leaves received samples, and whom it tells when they come late.
struct Inbox {
  std::mutex mutex;
  std::deque<Sample> samples;
  std::mutex notify_mutex;  // held while notifying
  Reader::Notify notify;
  std::atomic<std::thread::id> taker;  // who takes needs no telling

  void put(Sample sample) {
    {
      const std::lock_guard lock(mutex);
      samples.push_back(std::move(sample));
    }
    if (taker.load() != std::this_thread::get_id()) signal();
  }
  void signal() {
    const std::lock_guard lock(notify_mutex);
    if (notify) notify();
  }
};

class FaultyReader final : public Reader {
 public:
  FaultyReader(std::unique_ptr<Reader> inner, std::shared_ptr<Inbox> inbox, std::shared_ptr<FaultLine> line)
      : inner_(std::move(inner)), inbox_(std::move(inbox)), line_(std::move(line)) {}
  ~FaultyReader() override {
    on_data(nullptr);
    line_->close();
  }

  std::size_t take(std::span<Sample> out) override {
    inbox_->taker = std::this_thread::get_id();
    Sample batch[16];
    while (const std::size_t taken = inner_->take(batch)) {
      for (std::size_t i = 0; i < taken; ++i) line_->process(std::move(batch[i]));
    }
    inbox_->taker = std::thread::id();
    std::size_t count = 0;
    const std::lock_guard lock(inbox_->mutex);
    while (count < out.size() && !inbox_->samples.empty()) {
      out[count++] = std::move(inbox_->samples.front());
      inbox_->samples.pop_front();
    }
    return count;
  }
  void on_data(Notify notify) override {
    const bool wanted = static_cast<bool>(notify);
    {
      const std::lock_guard lock(inbox_->notify_mutex);
      inbox_->notify = std::move(notify);
    }
    if (!wanted) {
      inner_->on_data(nullptr);
      return;
    }
    inner_->on_data([inbox = inbox_] { inbox->signal(); });
    bool waiting = false;
    {
      const std::lock_guard lock(inbox_->mutex);
      waiting = !inbox_->samples.empty();
    }
    if (waiting) inbox_->signal();
  }
  LinkStats stats() const override { return inner_->stats(); }
  const EndpointConfig& config() const override { return inner_->config(); }
  Gid gid() const override { return inner_->gid(); }

 private:
  const std::unique_ptr<Reader> inner_;
  const std::shared_ptr<Inbox> inbox_;
  const std::shared_ptr<FaultLine> line_;
};

}  // namespace

FaultyParticipant::FaultyParticipant(std::unique_ptr<Participant> inner, FaultPlan plan)
    : inner_(std::move(inner)),
      plan_(std::move(plan)),
      start_(std::chrono::steady_clock::now()),
      delays_(std::make_shared<fault::DelayThread>()) {}

std::vector<FaultRule> FaultyParticipant::rules_of(const std::string& topic, FaultSide side) const {
  std::vector<FaultRule> rules;
  for (const auto& rule : plan_.rules) {
    if (rule.side == side && covers(rule.topic, topic)) rules.push_back(rule);
  }
  return rules;
}

std::shared_ptr<FaultLine> FaultyParticipant::make_line(const EndpointConfig& config, FaultSide side,
                                                        std::vector<FaultRule> rules, FaultLine::Deliver deliver) {
  const std::lock_guard lock(mutex_);
  std::uint64_t ordinal = 0;
  for (const auto& line : lines_) ordinal += line.topic == config.topic && line.side == side;
  std::uint64_t seed = hash(config.topic, 0xcbf29ce484222325u ^ plan_.seed);
  seed = hash(side == FaultSide::writing ? "w" : "r", seed) + ordinal;
  auto line = std::make_shared<FaultLine>(std::move(rules), seed, start_, delays_, std::move(deliver));
  for (const auto& [pattern, muted_side] : muted_) {
    if (muted_side == side && covers(pattern, config.topic)) line->mute(true);
  }
  lines_.push_back({config.topic, side, line});
  return line;
}

Result<std::unique_ptr<Writer>> FaultyParticipant::writer(const EndpointConfig& config) {
  auto inner = inner_->writer(config);
  auto rules = rules_of(config.topic, FaultSide::writing);
  if (!inner || rules.empty()) return inner;
  std::shared_ptr<Writer> shared(*std::move(inner));
  // The line does not own the writer: it outlives it, closed, for its counters.
  auto line = make_line(config, FaultSide::writing, std::move(rules), [writer = shared.get()](Sample sample) {
    // A failure is counted by the inner writer (send_failed); whoever published is long gone.
    (void)writer->forward(sample.bytes(), sample.info().source_time);
  });
  return std::unique_ptr<Writer>(std::make_unique<FaultyWriter>(std::move(shared), std::move(line)));
}

Result<std::unique_ptr<Reader>> FaultyParticipant::reader(const EndpointConfig& config) {
  auto inner = inner_->reader(config);
  auto rules = rules_of(config.topic, FaultSide::reading);
  if (!inner || rules.empty()) return inner;
  auto inbox = std::make_shared<Inbox>();
  auto line = make_line(config, FaultSide::reading, std::move(rules),
                        [inbox](Sample sample) { inbox->put(std::move(sample)); });
  return std::unique_ptr<Reader>(std::make_unique<FaultyReader>(*std::move(inner), std::move(inbox), std::move(line)));
}

void FaultyParticipant::mute(const std::string& topic, FaultSide side) {
  set_muted(topic, side, true);
}

void FaultyParticipant::unmute(const std::string& topic, FaultSide side) {
  set_muted(topic, side, false);
}

void FaultyParticipant::set_muted(const std::string& topic, FaultSide side, bool on) {
  const std::lock_guard lock(mutex_);
  std::erase(muted_, std::pair(topic, side));
  if (on) muted_.emplace_back(topic, side);
  for (const auto& line : lines_) {
    if (line.side == side && covers(topic, line.topic)) line.line->mute(on);
  }
}

FaultCounters FaultyParticipant::counters(const std::string& topic, FaultSide side) const {
  FaultCounters sum;
  const std::lock_guard lock(mutex_);
  for (const auto& line : lines_) {
    if (line.side != side || !covers(topic, line.topic)) continue;
    const FaultCounters one = line.line->counters();
    sum.samples += one.samples;
    sum.muted += one.muted;
    sum.dropped += one.dropped;
    sum.truncated += one.truncated;
    sum.corrupted += one.corrupted;
    sum.duplicated += one.duplicated;
    sum.delayed += one.delayed;
    sum.reordered += one.reordered;
  }
  return sum;
}

std::string FaultyParticipant::explain() const {
  std::string text = inner_->explain() + "faults injected by rule, seed " + std::to_string(plan_.seed) + ":";
  for (const auto& rule : plan_.rules) {
    text += std::string(rule.side == FaultSide::writing ? " writing " : " reading ") + rule.topic;
  }
  return text + "\n";
}

std::unique_ptr<FaultyParticipant> wrap_with_faults(std::unique_ptr<Participant> inner, FaultPlan plan) {
  return std::make_unique<FaultyParticipant>(std::move(inner), std::move(plan));
}

}  // namespace adit
