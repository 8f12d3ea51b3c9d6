#pragma once

#include <atomic>
#include <memory>

#include <fastdds/dds/publisher/DataWriterListener.hpp>

#include "middleware/fastdds/vendor_participant.hpp"
#include "middleware/participant.hpp"

namespace adit::fastdds {

class FastWriter final : public Writer, private dds::DataWriterListener {
 public:
  static Result<std::unique_ptr<Writer>> create(std::shared_ptr<VendorParticipant> participant,
                                                const EndpointConfig& config);
  ~FastWriter() override;

  using Writer::forward;
  using Writer::publish;
  Result<void> publish(const Encoder& message, Time source_time) override;
  Result<void> forward(Bytes cdr, Time source_time) override;
  bool has_remote_readers() const override { return remote_readers_.load(std::memory_order_relaxed) > 0; }
  Result<void> wait_for_acknowledgements(Duration timeout) override;
  LinkStats stats() const override;
  const EndpointConfig& config() const override { return config_; }
  Gid gid() const override { return gid_; }

 private:
  FastWriter(std::shared_ptr<VendorParticipant> participant, const EndpointConfig& config)
      : participant_(std::move(participant)), config_(config) {}

  void on_publication_matched(dds::DataWriter*, const dds::PublicationMatchedStatus& status) override;
  void on_offered_deadline_missed(dds::DataWriter*, const dds::OfferedDeadlineMissedStatus& status) override;
  void on_liveliness_lost(dds::DataWriter*, const dds::LivelinessLostStatus& status) override;
  void post(Event::Kind kind, const Gid& remote, std::uint64_t count, std::string text);

  std::shared_ptr<VendorParticipant> participant_;
  const EndpointConfig config_;
  dds::DataWriter* writer_ = nullptr;
  bool has_topic_ = false;
  Gid gid_;
  std::atomic<std::int32_t> remote_readers_{0}, matched_{0};
  std::atomic<std::uint64_t> sent_{0}, sent_bytes_{0}, failed_{0};
};

}  // namespace adit::fastdds
