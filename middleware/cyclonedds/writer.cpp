#include <dds/dds.h>

#include <cstring>
#include <mutex>

#include "middleware/cyclonedds/participant.hpp"
#include "middleware/cyclonedds/qos_mapping.hpp"
#include "middleware/cyclonedds/raw_type.hpp"

namespace adit::cyclonedds {
namespace {

class CycloneWriter final : public Writer {
 public:
  CycloneWriter(ParticipantState& state, const EndpointConfig& config)
      : state_(state), config_(config), watch_(state, config_, true) {}
  ~CycloneWriter() override {
    if (writer_ <= 0) return;
    dds_delete(writer_);
    state_.close_topic(config_.topic);
  }

  Result<void> open() {
    auto topic = state_.open_topic(config_, type_);
    if (!topic) return topic.error();
    const auto listener = watch_.make_listener();
    const QosPointer qos = writer_qos(config_);
    writer_ = dds_create_writer(state_.participant, *topic, qos.get(), listener.get());
    dds_delete(*topic);
    if (writer_ < 0) {
      state_.close_topic(config_.topic);
      return to_error(writer_, "writer of " + config_.topic);
    }
    gid_ = gid_of(writer_);
    watch_.created(writer_);
    return {};
  }

  Result<void> publish(const Encoder& message, Time source_time) override {
    const std::size_t size = message.size();
    RawSample* const sample = RawSample::create(type_, SDK_DATA, size);
    if (!sample) return refused(no_memory(size));
    const std::size_t written = message.write({sample->payload, size});
    if (written == 0 || written > size) {
      ddsi_serdata_unref(sample);
      return refused({ErrorCode::malformed, "writer of " + config_.topic + ": the message did not encode to its size"});
    }
    std::memset(sample->payload + written, 0, sample->size - written);
    return send(sample, source_time);
  }

  Result<void> forward(Bytes cdr, Time source_time) override {
    RawSample* const sample = RawSample::create(type_, SDK_DATA, cdr.size());
    if (!sample) return refused(no_memory(cdr.size()));
    if (!cdr.empty()) std::memcpy(sample->payload, cdr.data(), cdr.size());
    std::memset(sample->payload + cdr.size(), 0, sample->size - cdr.size());
    if (!sample->is_plain_cdr()) {
      ddsi_serdata_unref(sample);
      return refused({ErrorCode::malformed, "writer of " + config_.topic +
                                                ": a serialized sample starts with 00 00 or 00 01 (CDR) and two bytes "
                                                "of options"});
    }
    return send(sample, source_time);
  }

  bool has_remote_readers() const override { return watch_.has_remote(); }

  Result<void> wait_for_acknowledgements(Duration timeout) override {
    const dds_return_t code = dds_wait_for_acks(writer_, timeout.count());
    if (code != DDS_RETCODE_OK) return to_error(code, "acknowledgements of " + config_.topic);
    return {};
  }

  LinkStats stats() const override {
    const std::lock_guard lock(mutex_);
    LinkStats stats = stats_;
    stats.matched = watch_.matched();
    return stats;
  }
  const EndpointConfig& config() const override { return config_; }
  Gid gid() const override { return gid_; }

 private:
  // Takes over the reference. The mutex keeps our count of sequence numbers equal to Cyclone's.
  Result<void> send(RawSample* sample, Time source_time) {
    const std::size_t size = sample->size;
    sample->timestamp.v = source_time.time_since_epoch().count();
    sample->statusinfo = 0;
    const std::lock_guard lock(mutex_);
    sample->sequence = stats_.sent + 1;
    const dds_return_t code = dds_forwardcdr(writer_, sample);
    if (code != DDS_RETCODE_OK) {
      ++stats_.send_failed;
      return to_error(code, "writer of " + config_.topic);
    }
    ++stats_.sent;
    stats_.sent_bytes += size;
    return {};
  }

  Result<void> refused(Error error) {
    const std::lock_guard lock(mutex_);
    ++stats_.send_failed;
    return error;
  }
  Error no_memory(std::size_t size) const {
    return {ErrorCode::out_of_resources,
            "writer of " + config_.topic + ": no memory for a sample of " + std::to_string(size) + " bytes"};
  }

  ParticipantState& state_;
  const EndpointConfig config_;
  EndpointWatch watch_;
  const ddsi_sertype* type_ = nullptr;
  dds_entity_t writer_ = 0;
  Gid gid_;
  mutable std::mutex mutex_;
  LinkStats stats_;
};

}  // namespace

Result<std::unique_ptr<Writer>> make_writer(ParticipantState& state, const EndpointConfig& config) {
  auto writer = std::make_unique<CycloneWriter>(state, config);
  if (auto opened = writer->open(); !opened) return opened.error();
  return std::unique_ptr<Writer>(std::move(writer));
}

}  // namespace adit::cyclonedds
