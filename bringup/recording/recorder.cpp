#include "bringup/recording/recorder.hpp"

#include <algorithm>

#include "bringup/commands/topic_monitor.hpp"
#include "components/dataset/bag_qos.hpp"
#include "idl/type_registry.hpp"

namespace adit {
namespace {

constexpr auto kLookEvery = std::chrono::milliseconds(500);
constexpr auto kCommitEvery = std::chrono::seconds(1);
constexpr int kSamplesAtOnce = 64;

std::uint64_t missed(const Reader& reader) {
  const LinkStats stats = reader.stats();
  return stats.lost + stats.overwritten + stats.rejected;
}

// All profiles offered: a player then knows what readers may have asked for.
std::string offered_profiles(const std::vector<EndpointInfo>& writers) {
  std::vector<dataset::BagQos> profiles;
  for (const EndpointInfo& writer : writers) {
    profiles.push_back({writer.qos.reliability == Qos::Reliability::reliable,
                        writer.qos.durability == Qos::Durability::transient_local,
                        writer.history_known ? writer.qos.depth : std::max(writer.qos.depth, 10U)});
  }
  return dataset::bag_qos_text(profiles);
}

}  // namespace

struct Recorder::Subscription {
  TopicState state;
  std::string dds_type, hash;
  TypeInfo type{};  // refers to the strings above
  Qos qos;
  std::size_t index = 0;           // in the bag
  std::uint64_t lost_before = 0;   // by readers that were replaced
  std::unique_ptr<Reader> reader;  // null: nobody wrote it yet, or it was refused
};

Recorder::Recorder(RecorderConfig config, std::unique_ptr<Participant> participant,
                   std::unique_ptr<dataset::BagWriter> writer)
    : config_(std::move(config)), participant_(std::move(participant)), writer_(std::move(writer)) {
  for (const std::string& topic : config_.topics) {
    subscriptions_.push_back(std::make_unique<Subscription>());
    subscriptions_.back()->state.name = topic;
  }
}

Recorder::~Recorder() {
  (void)close();
}

Result<std::unique_ptr<Recorder>> Recorder::open(const RecorderConfig& config) {
  Result<std::unique_ptr<Participant>> participant = adit::open(config.participant);
  if (!participant) return participant.error();
  auto writer = dataset::BagWriter::create(config.folder, dataset::BagWriter::Safety::each_commit);
  if (!writer) return writer.error();
  return std::unique_ptr<Recorder>(new Recorder(config, *std::move(participant), *std::move(writer)));
}

void Recorder::look() {
  std::map<std::string, std::vector<EndpointInfo>> writers;
  for (const EndpointInfo& endpoint : participant_->graph().endpoints) {
    if (endpoint.is_writer && endpoint.topic.starts_with('/')) writers[endpoint.topic].push_back(endpoint);
  }
  for (const auto& [topic, of_topic] : writers) {
    const bool wanted = config_.topics.empty() || std::ranges::count(config_.topics, topic) > 0;
    if (wanted) follow(topic, of_topic);
  }
}

void Recorder::follow(const std::string& topic, const std::vector<EndpointInfo>& writers) {
  auto found = std::ranges::find_if(subscriptions_, [&](const auto& s) { return s->state.name == topic; });
  if (found == subscriptions_.end()) {
    subscriptions_.push_back(std::make_unique<Subscription>());
    found = subscriptions_.end() - 1;
    (*found)->state.name = topic;
  }
  Subscription& s = **found;
  if (s.state.type.empty()) {
    const EndpointInfo& first = writers.front();
    s.state.type = first.type;
    s.dds_type = first.dds_type;
    s.hash = first.type_hash;
    const MessageType* const known = find_type(s.state.type);
    const auto typical_size = known ? known->info->typical_size : std::size_t{1024};
    s.type = {s.state.type, s.dds_type, s.hash, known ? known->info->schema : std::string_view(), typical_size};
    const auto index =
        writer_->add_topic({topic, s.state.type, offered_profiles(writers), s.hash, std::string(s.type.schema)});
    if (!index) {
      s.state.problem = index.error().message;
      return;
    }
    s.index = *index;
  }
  std::vector<EndpointInfo> matching;
  for (const EndpointInfo& writer : writers) {
    if (writer.dds_type == s.dds_type) {
      matching.push_back(writer);
    } else {
      s.state.problem = "also written as " + writer.type + ", which is not recorded";
    }
  }
  if (matching.empty()) return;
  const Qos qos = matching_qos(matching);
  if (s.reader && qos == s.qos) return;
  // A writer that offers less than the reader asks for has joined: a reader that asks for less takes its place.
  s.qos = qos;
  subscribe(s);
}

void Recorder::subscribe(Subscription& s) {
  if (s.reader) {
    s.reader->on_data(nullptr);
    (void)drain(s);
    s.lost_before += missed(*s.reader);
    s.reader.reset();
  }
  EndpointConfig endpoint;
  endpoint.topic = s.state.name;
  endpoint.type = &s.type;
  endpoint.qos = s.qos;
  endpoint.node = "/adit_record";
  Result<std::unique_ptr<Reader>> reader = participant_->reader(endpoint);
  if (!reader) {
    s.state.problem = reader.error().message;
    return;
  }
  s.reader = *std::move(reader);
  s.reader->on_data([this] {
    const std::lock_guard lock(mutex_);
    ready_ = true;
    wake_.notify_one();
  });
}

Result<bool> Recorder::drain(Subscription& s) {
  for (int i = 0; i < kSamplesAtOnce; ++i) {
    Sample sample;
    if (s.reader->take({&sample, 1}) == 0) return false;
    const auto stamp = sample.info().received_time.time_since_epoch().count();
    if (Result<void> written = writer_->write({s.index, stamp, sample.bytes()}); !written) return written.error();
    ++s.state.samples;
    s.state.bytes += sample.bytes().size();
    // Here too: on a slow disk a round of large samples takes longer than what may be lost.
    if (Result<void> committed = commit_when_due(); !committed) return committed.error();
  }
  return true;
}

Result<void> Recorder::commit_when_due() {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_commit_) return {};
  next_commit_ = now + kCommitEvery;
  return writer_->commit();
}

Result<bool> Recorder::drain_all() {
  bool more = false;
  for (const auto& subscription : subscriptions_) {
    if (!subscription->reader) continue;
    const Result<bool> again = drain(*subscription);
    if (!again) return again;
    more |= *again;
  }
  return more;
}

Result<void> Recorder::step(Duration limit) {
  using Steady = std::chrono::steady_clock;
  if (Steady::now() >= next_look_) {
    look();
    next_look_ = Steady::now() + kLookEvery;
  }
  {
    std::unique_lock lock(mutex_);
    wake_.wait_until(lock, std::min(Steady::now() + limit, next_look_), [this] { return ready_; });
    ready_ = false;
  }
  const Result<bool> more = drain_all();
  if (!more) return more.error();
  if (*more) {
    const std::lock_guard lock(mutex_);
    ready_ = true;
  }
  return commit_when_due();
}

Result<void> Recorder::close() {
  if (!writer_) return {};
  Result<bool> more = true;
  // What has arrived until now, not what goes on arriving.
  for (const auto& subscription : subscriptions_) {
    if (subscription->reader) subscription->reader->on_data(nullptr);
  }
  for (int round = 0; round < 8 && more && *more; ++round) more = drain_all();
  for (const auto& s : subscriptions_) {
    if (!s->reader) continue;
    s->lost_before += missed(*s->reader);
    s->reader.reset();
  }
  const std::unique_ptr<dataset::BagWriter> writer = std::move(writer_);
  const Result<void> closed = writer->close();
  return more ? closed : Result<void>(more.error());
}

std::vector<Recorder::TopicState> Recorder::topics() const {
  std::vector<TopicState> out;
  for (const auto& s : subscriptions_) {
    out.push_back(s->state);
    out.back().lost = s->lost_before + (s->reader ? missed(*s->reader) : 0);
    if (s->state.type.empty()) out.back().problem = "nobody has written it";
  }
  return out;
}

}  // namespace adit
