#include "middleware/fastdds/writer.hpp"

#include <cstring>
#include <thread>

#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>

#include "middleware/fastdds/serialized_type.hpp"

namespace adit::fastdds {
namespace {

// A cloud that goes out in thousands of packets must not hold up the component that publishes it.
constexpr std::size_t largest_synchronous_message = 64 << 10;

// Remembers how many bytes went into the vendor's buffer.
class CountingEncoder final : public Encoder {
 public:
  explicit CountingEncoder(const Encoder& message) : message_(message) {}
  std::size_t size() const override { return message_.size(); }
  std::size_t write(MutableBytes out) const override { return written_ = message_.write(out); }
  std::size_t written() const { return written_; }

 private:
  const Encoder& message_;
  mutable std::size_t written_ = 0;
};

class CopyingEncoder final : public Encoder {
 public:
  explicit CopyingEncoder(Bytes bytes) : bytes_(bytes) {}
  std::size_t size() const override { return bytes_.size(); }
  std::size_t write(MutableBytes out) const override {
    if (out.size() < bytes_.size()) return 0;
    std::memcpy(out.data(), bytes_.data(), bytes_.size());
    return bytes_.size();
  }

 private:
  Bytes bytes_;
};

eprosima::fastrtps::Time_t to_vendor_time(Time time) {
  const auto since_epoch = std::max(time.time_since_epoch(), Duration::zero());
  const auto seconds = std::chrono::floor<std::chrono::seconds>(since_epoch);
  return {static_cast<std::int32_t>(seconds.count()), static_cast<std::uint32_t>((since_epoch - seconds).count())};
}

}  // namespace

Result<std::unique_ptr<Writer>> FastWriter::create(std::shared_ptr<VendorParticipant> participant,
                                                   const EndpointConfig& config) {
  std::unique_ptr<FastWriter> writer(new FastWriter(std::move(participant), config));
  auto& owner = *writer->participant_;
  const auto topic = owner.acquire_topic(config.topic, *config.type);
  if (!topic) return topic.error();
  writer->has_topic_ = true;
  const bool synchronous = owner.loopback() || config.type->typical_size <= largest_synchronous_message;
  writer->writer_ = owner.publisher().create_datawriter(*topic, writer_qos(config, synchronous), writer.get(),
                                                        dds::StatusMask::all());
  if (!writer->writer_ || writer->writer_->enable() != ReturnCode_t::RETCODE_OK) {
    return Error{ErrorCode::invalid_argument,
                 "Fast DDS refuses a writer of '" + config.topic + "' with QoS " + to_string(config.qos)};
  }
  writer->gid_ = to_gid(writer->writer_->guid());
  owner.add_endpoint(config, writer->gid_, true);
  return std::unique_ptr<Writer>(std::move(writer));
}

FastWriter::~FastWriter() {
  participant_->remove_endpoint(gid_);
  if (auto* const heartbeat = participant_->first_heartbeat()) heartbeat->forget(gid_);
  if (writer_) participant_->publisher().delete_datawriter(writer_);
  if (has_topic_) participant_->release_topic(config_.topic);
}

Result<void> FastWriter::publish(const Encoder& message, Time source_time) {
  CountingEncoder counting(message);
  const auto write = [&] {
    return writer_->write_w_timestamp(static_cast<Encoder*>(&counting), dds::HANDLE_NIL, to_vendor_time(source_time));
  };
  const auto start = std::chrono::steady_clock::now();
  ReturnCode_t code = write();
  // Room may come before max_blocking is over. A volatile keep-all writer that waits for it is told "time-out" too
  // early when all its samples are acknowledged at once (the vendor then finds no oldest sample to remove); and the
  // payloads of a topic are shared within a process, where a reader that is full holds them.
  const bool reliable = config_.qos.reliability == Qos::Reliability::reliable;
  while (reliable && (code == ReturnCode_t::RETCODE_TIMEOUT || code == ReturnCode_t::RETCODE_OUT_OF_RESOURCES) &&
         std::chrono::steady_clock::now() - start < config_.qos.max_blocking) {
    if (code == ReturnCode_t::RETCODE_OUT_OF_RESOURCES) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    code = write();
  }
  if (code == ReturnCode_t::RETCODE_OK) {
    sent_.fetch_add(1, std::memory_order_relaxed);
    sent_bytes_.fetch_add(counting.written(), std::memory_order_relaxed);
    return {};
  }
  failed_.fetch_add(1, std::memory_order_relaxed);
  if (code == ReturnCode_t::RETCODE_TIMEOUT || code == ReturnCode_t::RETCODE_OUT_OF_RESOURCES) {
    return Error{ErrorCode::timeout, "'" + config_.topic + "': a reliable reader took no sample for max_blocking"};
  }
  if (counting.written() < 4)
    return Error{ErrorCode::malformed, "'" + config_.topic + "': the message cannot be encoded"};
  return Error{ErrorCode::out_of_resources, "'" + config_.topic + "': Fast DDS cannot send a sample of " +
                                                std::to_string(counting.written()) + " bytes (code " +
                                                std::to_string(code()) + ")"};
}

Result<void> FastWriter::forward(Bytes cdr, Time source_time) {
  if (!is_plain_cdr(cdr)) {
    failed_.fetch_add(1, std::memory_order_relaxed);
    return Error{ErrorCode::malformed, "'" + config_.topic + "': forward() takes plain CDR with its 4-byte header"};
  }
  return publish(CopyingEncoder(cdr), source_time);
}

Result<void> FastWriter::wait_for_acknowledgements(Duration timeout) {
  if (writer_->wait_for_acknowledgments(to_vendor(timeout)) == ReturnCode_t::RETCODE_OK) return {};
  return Error{ErrorCode::timeout, "'" + config_.topic + "': not every reader acknowledged in time"};
}

LinkStats FastWriter::stats() const {
  LinkStats stats;
  stats.sent = sent_.load(std::memory_order_relaxed);
  stats.sent_bytes = sent_bytes_.load(std::memory_order_relaxed);
  stats.send_failed = failed_.load(std::memory_order_relaxed);
  stats.matched = static_cast<std::uint32_t>(matched_.load(std::memory_order_relaxed));
  return stats;
}

void FastWriter::on_publication_matched(dds::DataWriter* writer, const dds::PublicationMatchedStatus& status) {
  const Gid local = to_gid(writer->guid()), remote = to_gid(status.last_subscription_handle);
  const auto change = status.current_count_change;
  if (!local.same_participant(remote)) remote_readers_.fetch_add(change, std::memory_order_relaxed);
  if (change <= 0) {
    if (auto* const heartbeat = participant_->first_heartbeat()) heartbeat->forget(local, remote);
  } else if (config_.qos.reliability == Qos::Reliability::reliable &&
             config_.qos.durability == Qos::Durability::volatile_) {
    // Sequence numbers count what was sent. One too low only makes the reader ask for what the vendor says is gone.
    participant_->expect_first_heartbeat(local, remote, sent_.load(std::memory_order_relaxed));
  }
  matched_.store(status.current_count, std::memory_order_relaxed);
  post(change > 0 ? Event::Kind::matched : Event::Kind::unmatched, remote, 0,
       std::string("writer of '") + config_.topic + (change > 0 ? "' matched reader " : "' lost reader ") +
           to_string(remote));
}

void FastWriter::on_offered_deadline_missed(dds::DataWriter*, const dds::OfferedDeadlineMissedStatus& status) {
  post(Event::Kind::deadline_missed, {}, status.total_count_change,
       "writer of '" + config_.topic + "' did not publish within the deadline it promises (" + to_string(config_.qos) +
           ")");
}

void FastWriter::on_liveliness_lost(dds::DataWriter*, const dds::LivelinessLostStatus& status) {
  post(Event::Kind::liveliness_lost, {}, static_cast<std::uint64_t>(status.total_count_change),
       "writer of '" + config_.topic + "' did not assert its liveliness within its lease");
}

void FastWriter::post(Event::Kind kind, const Gid& remote, std::uint64_t count, std::string text) {
  Event event;
  event.kind = kind;
  event.topic = config_.topic;
  event.is_writer = true;
  event.local = to_gid(writer_->guid());
  event.remote = remote;
  event.count = count;
  event.text = std::move(text);
  participant_->events().post(std::move(event));
}

}  // namespace adit::fastdds
