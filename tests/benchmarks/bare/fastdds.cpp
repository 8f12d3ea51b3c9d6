#include <atomic>
#include <cstring>
#include <thread>

#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>

#include "middleware/fastdds/configuration.hpp"
#include "tests/benchmarks/bare/bare.hpp"
#include "tests/benchmarks/bare/fastdds_type.hpp"

namespace adit::bench {
namespace {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using ReturnCode = eprosima::fastrtps::types::ReturnCode_t;

struct Endpoint {
  dds::DomainParticipant* participant = nullptr;
  dds::Topic* topic = nullptr;

  Endpoint(std::uint32_t domain, std::size_t bytes) {
    ParticipantConfig config;
    config.domain = domain;
    auto configuration = fastdds::configure(config, "");
    if (!configuration) return;
    auto& factory = *dds::DomainParticipantFactory::get_instance();
    participant = factory.create_participant(domain, configuration->qos);
    if (!participant) return;
    *configuration->audible = true;
    dds::TypeSupport(new BytesType("adit_bench::Bytes", bytes)).register_type(participant);
    topic = participant->create_topic("adit_bench", "adit_bench::Bytes", dds::TOPIC_QOS_DEFAULT);
  }
  ~Endpoint() {
    if (!participant) return;
    participant->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(participant);
  }
  template <class Qos>
  static Qos qos(Qos from) {
    from.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
    from.durability().kind = dds::VOLATILE_DURABILITY_QOS;
    from.history().kind = dds::KEEP_LAST_HISTORY_QOS;
    from.history().depth = 10;
    from.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    from.data_sharing().off();
    return from;
  }
};

class FastSender final : public Sender {
 public:
  FastSender(std::uint32_t domain, std::size_t bytes) : endpoint_(domain, bytes), bytes_(bytes) {
    if (!endpoint_.topic) return;
    auto* const publisher = endpoint_.participant->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
    writer_ = publisher->create_datawriter(endpoint_.topic, Endpoint::qos(dds::DATAWRITER_QOS_DEFAULT));
  }
  bool valid() const { return writer_; }
  bool matched() const override {
    dds::PublicationMatchedStatus status;
    return writer_->get_publication_matched_status(status) == ReturnCode::RETCODE_OK && status.current_count > 0;
  }
  bool send() override {
    const std::int64_t now = monotonic_ns();
    std::memcpy(bytes_.data(), &now, sizeof now);
    return writer_->write(&bytes_);
  }

 private:
  Endpoint endpoint_;
  BytesType::Bytes bytes_;
  dds::DataWriter* writer_ = nullptr;
};

class FastReceiver final : public Receiver, private dds::DataReaderListener {
 public:
  FastReceiver(std::uint32_t domain, std::size_t bytes, TakeIn take_in, OnMessage on_message)
      : on_message_(std::move(on_message)), endpoint_(domain, bytes) {
    if (!endpoint_.topic) return;
    auto* const subscriber = endpoint_.participant->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
    const auto qos = Endpoint::qos(dds::DATAREADER_QOS_DEFAULT);
    if (take_in == TakeIn::vendor_thread) {
      reader_ = subscriber->create_datareader(endpoint_.topic, qos, this, dds::StatusMask::data_available());
      return;
    }
    reader_ = subscriber->create_datareader(endpoint_.topic, qos);
    if (!reader_) return;
    reader_->get_statuscondition().set_enabled_statuses(dds::StatusMask::data_available());
    waitset_.attach_condition(reader_->get_statuscondition());
    thread_ = std::thread([this] { wait(); });
  }
  ~FastReceiver() override {
    stop_ = true;
    if (thread_.joinable()) {
      thread_.join();
      waitset_.detach_condition(reader_->get_statuscondition());
    }
    if (reader_) reader_->set_listener(nullptr);
  }
  bool valid() const { return reader_; }

 private:
  void wait() {
    dds::ConditionSeq triggered;
    while (!stop_) {
      if (waitset_.wait(triggered, {0, 200'000'000}) == ReturnCode::RETCODE_OK) take();
    }
  }
  void on_data_available(dds::DataReader*) override { take(); }
  void take() {
    dds::SampleInfo info;
    while (reader_->take_next_sample(&bytes_, &info) == ReturnCode::RETCODE_OK) {
      if (!info.valid_data || bytes_.size() < sizeof(std::int64_t)) continue;
      std::int64_t sent = 0;
      std::memcpy(&sent, bytes_.data(), sizeof sent);
      on_message_(sent);
    }
  }

  const OnMessage on_message_;
  Endpoint endpoint_;
  BytesType::Bytes bytes_;
  dds::DataReader* reader_ = nullptr;
  dds::WaitSet waitset_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace

std::unique_ptr<Sender> make_bare_fastdds_sender(std::uint32_t domain, std::size_t bytes) {
  auto sender = std::make_unique<FastSender>(domain, bytes);
  if (!sender->valid()) return nullptr;
  return sender;
}

std::unique_ptr<Receiver> make_bare_fastdds_receiver(std::uint32_t domain, std::size_t bytes, TakeIn take_in,
                                                     OnMessage on_message) {
  auto receiver = std::make_unique<FastReceiver>(domain, bytes, take_in, std::move(on_message));
  if (!receiver->valid()) return nullptr;
  return receiver;
}

}  // namespace adit::bench
