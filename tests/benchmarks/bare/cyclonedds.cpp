#include <dds/dds.h>

#include <atomic>
#include <cstring>
#include <thread>
#include <vector>

#include "bytes.h"
#include "middleware/cyclonedds/configuration.hpp"
#include "tests/benchmarks/bare/bare.hpp"

namespace adit::bench {
namespace {

constexpr dds_domainid_t internal_domain = 1;

struct Endpoint {
  dds_entity_t domain = 0, participant = 0, topic = 0;
  dds_qos_t* qos = nullptr;

  explicit Endpoint(std::uint32_t number) {
    ParticipantConfig config;
    config.domain = number;
    const auto configuration = cyclonedds::make_configuration(config);
    if (!configuration) return;
    domain = dds_create_domain(internal_domain, configuration->xml.c_str());
    participant = dds_create_participant(internal_domain, nullptr, nullptr);
    topic = dds_create_topic(participant, &adit_bench_Bytes_desc, "adit_bench", nullptr, nullptr);
    qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
  }
  ~Endpoint() {
    if (participant > 0) dds_delete(participant);
    if (domain > 0) dds_delete(domain);
    if (qos) dds_delete_qos(qos);
  }
  bool valid() const { return domain > 0 && participant > 0 && topic > 0; }
};

class CycloneSender final : public Sender {
 public:
  CycloneSender(std::uint32_t domain, std::size_t bytes) : endpoint_(domain), bytes_(bytes) {
    if (endpoint_.valid()) {
      writer_ = dds_create_writer(endpoint_.participant, endpoint_.topic, endpoint_.qos, nullptr);
    }
    message_.data._length = message_.data._maximum = static_cast<std::uint32_t>(bytes);
    message_.data._buffer = bytes_.data();
  }
  bool valid() const { return writer_ > 0; }
  bool matched() const override {
    dds_publication_matched_status_t status;
    return dds_get_publication_matched_status(writer_, &status) == DDS_RETCODE_OK && status.current_count > 0;
  }
  bool send() override {
    const std::int64_t now = monotonic_ns();
    std::memcpy(bytes_.data(), &now, sizeof now);
    return dds_write(writer_, &message_) == DDS_RETCODE_OK;
  }

 private:
  Endpoint endpoint_;
  std::vector<std::uint8_t> bytes_;
  adit_bench_Bytes message_{};
  dds_entity_t writer_ = 0;
};

class CycloneReceiver final : public Receiver {
 public:
  CycloneReceiver(std::uint32_t domain, TakeIn take_in, OnMessage on_message)
      : on_message_(std::move(on_message)), endpoint_(domain) {
    if (!endpoint_.valid()) return;
    if (take_in == TakeIn::own_thread) {
      reader_ = dds_create_reader(endpoint_.participant, endpoint_.topic, endpoint_.qos, nullptr);
      waitset_ = dds_create_waitset(endpoint_.participant);
      dds_waitset_attach(waitset_, dds_create_readcondition(reader_, DDS_ANY_STATE), 0);
      thread_ = std::thread([this] { wait(); });
    } else {
      dds_listener_t* const listener = dds_create_listener(this);
      dds_lset_data_available(
          listener, [](dds_entity_t reader, void* self) { static_cast<CycloneReceiver*>(self)->take(reader); });
      reader_ = dds_create_reader(endpoint_.participant, endpoint_.topic, endpoint_.qos, listener);
      dds_delete_listener(listener);
    }
  }
  ~CycloneReceiver() override {
    stop_ = true;
    if (thread_.joinable()) {
      dds_waitset_set_trigger(waitset_, true);
      thread_.join();
    }
    if (reader_ > 0) dds_delete(reader_);
  }
  bool valid() const { return reader_ > 0; }

 private:
  void wait() {
    while (!stop_) {
      dds_attach_t triggered[1];
      if (dds_waitset_wait(waitset_, triggered, 1, DDS_MSECS(500)) > 0 && !stop_) take(reader_);
    }
  }
  void take(dds_entity_t reader) {
    void* samples[8] = {};
    dds_sample_info_t infos[8];
    const dds_return_t taken = dds_take(reader, samples, infos, 8, 8);
    for (dds_return_t i = 0; i < taken; ++i) {
      const auto& message = *static_cast<const adit_bench_Bytes*>(samples[i]);
      if (!infos[i].valid_data || message.data._length < sizeof(std::int64_t)) continue;
      std::int64_t sent = 0;
      std::memcpy(&sent, message.data._buffer, sizeof sent);
      on_message_(sent);
    }
    if (taken > 0) dds_return_loan(reader, samples, taken);
  }

  const OnMessage on_message_;
  Endpoint endpoint_;
  dds_entity_t reader_ = 0, waitset_ = 0;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace

std::unique_ptr<Sender> make_bare_cyclonedds_sender(std::uint32_t domain, std::size_t bytes) {
  auto sender = std::make_unique<CycloneSender>(domain, bytes);
  if (!sender->valid()) return nullptr;
  return sender;
}

std::unique_ptr<Receiver> make_bare_cyclonedds_receiver(std::uint32_t domain, std::size_t, TakeIn take_in,
                                                        OnMessage on_message) {
  auto receiver = std::make_unique<CycloneReceiver>(domain, take_in, std::move(on_message));
  if (!receiver->valid()) return nullptr;
  return receiver;
}

}  // namespace adit::bench
