#include "components/runtime/testing/fake_participant.hpp"

#include <atomic>
#include <deque>

namespace adit::testing {
namespace {

struct Buffer {
  std::atomic<int> references{1};
  std::vector<std::byte> bytes;
};

constexpr KeepAliveOperations buffer_operations = {
    [](void* handle) noexcept { static_cast<Buffer*>(handle)->references.fetch_add(1); },
    [](void* handle) noexcept {
      auto* const buffer = static_cast<Buffer*>(handle);
      if (buffer->references.fetch_sub(1) == 1) delete buffer;
    }};

struct Stored {
  Bytes bytes;
  MessageInfo info;
  KeepAlive memory;
};

}  // namespace

class FakeReader final : public Reader {
 public:
  FakeReader(FakeDomain& domain, EndpointConfig config, Gid gid)
      : domain_(domain), config_(std::move(config)), gid_(gid) {}
  ~FakeReader() override {
    const std::lock_guard lock(domain_.mutex_);
    std::erase(domain_.readers_, this);
  }

  std::size_t take(std::span<Sample> out) override {
    const std::lock_guard lock(mutex_);
    std::size_t n = 0;
    for (; n < out.size() && !waiting_.empty(); ++n) {
      Stored& first = waiting_.front();
      out[n] = Sample(first.bytes, first.info, std::move(first.memory));
      waiting_.pop_front();
      ++stats_.received;
      stats_.received_bytes += out[n].bytes().size();
    }
    return n;
  }

  void on_data(Notify notify) override {
    const std::lock_guard notifying(notify_mutex_);
    notify_ = std::move(notify);
    if (!notify_) return;
    const std::unique_lock lock(mutex_);
    if (!waiting_.empty()) notify_();
  }

  void deliver(const Stored& sample) {
    {
      const std::lock_guard lock(mutex_);
      if (config_.qos.depth != 0 && waiting_.size() >= config_.qos.depth) {
        waiting_.pop_front();
        ++stats_.overwritten;
      }
      waiting_.push_back(sample);
    }
    const std::lock_guard notifying(notify_mutex_);
    if (notify_) notify_();
  }

  LinkStats stats() const override {
    const std::lock_guard lock(mutex_);
    return stats_;
  }
  const EndpointConfig& config() const override { return config_; }
  Gid gid() const override { return gid_; }

 private:
  FakeDomain& domain_;
  const EndpointConfig config_;
  const Gid gid_;
  mutable std::mutex mutex_;
  std::deque<Stored> waiting_;
  LinkStats stats_;
  std::mutex notify_mutex_;
  Notify notify_;
};

class FakeWriter final : public Writer {
 public:
  FakeWriter(FakeDomain& domain, EndpointConfig config, Gid gid)
      : domain_(domain), config_(std::move(config)), gid_(gid) {}
  ~FakeWriter() override {
    const std::lock_guard lock(domain_.mutex_);
    std::erase(domain_.writers_, this);
  }

  Result<void> publish(const Encoder& message, Time source_time) override {
    auto* const buffer = new Buffer;
    buffer->bytes.resize(message.size());
    message.write(buffer->bytes);
    send(buffer, source_time);
    return {};
  }
  Result<void> forward(Bytes cdr, Time source_time) override {
    auto* const buffer = new Buffer;
    buffer->bytes.assign(cdr.begin(), cdr.end());
    send(buffer, source_time);
    return {};
  }

  bool matches(const FakeReader& reader) const {
    const EndpointConfig& other = reader.config();
    return other.topic == config_.topic && other.type->dds_name == config_.type->dds_name &&
           check(config_.qos, other.qos).empty() &&
           !(other.ignore_local && config_.ignore_local && reader.gid().same_participant(gid_));
  }
  void replay(FakeReader& reader) {
    if (reader.config().qos.durability != Qos::Durability::transient_local) return;
    for (const Stored& sample : retained_) reader.deliver(sample);
  }

  bool has_remote_readers() const override {
    const std::lock_guard lock(domain_.mutex_);
    for (const FakeReader* reader : domain_.readers_) {
      if (matches(*reader) && !reader->gid().same_participant(gid_)) return true;
    }
    return false;
  }
  Result<void> wait_for_acknowledgements(Duration) override { return {}; }
  LinkStats stats() const override {
    const std::lock_guard lock(domain_.mutex_);
    return stats_;
  }
  const EndpointConfig& config() const override { return config_; }
  Gid gid() const override { return gid_; }

 private:
  void send(Buffer* buffer, Time source_time) {
    const std::lock_guard lock(domain_.mutex_);
    ++stats_.sent;
    stats_.sent_bytes += buffer->bytes.size();
    const Stored sample{buffer->bytes, {source_time, system_now(), gid_, stats_.sent}, {&buffer_operations, buffer}};
    if (config_.qos.durability == Qos::Durability::transient_local) {
      retained_.push_back(sample);
      if (config_.qos.depth != 0 && retained_.size() > config_.qos.depth) retained_.pop_front();
    }
    for (FakeReader* reader : domain_.readers_) {
      if (matches(*reader)) reader->deliver(sample);
    }
  }

  FakeDomain& domain_;
  const EndpointConfig config_;
  const Gid gid_;
  LinkStats stats_;
  std::deque<Stored> retained_;
};

class FakeParticipant final : public Participant {
 public:
  FakeParticipant(FakeDomain& domain, ParticipantConfig config, Gid gid)
      : domain_(domain), config_(std::move(config)), gid_(gid) {}

  Result<std::unique_ptr<Writer>> writer(const EndpointConfig& config) override {
    const std::lock_guard lock(domain_.mutex_);
    auto writer = std::make_unique<FakeWriter>(domain_, config, next_gid());
    domain_.writers_.push_back(writer.get());
    return std::unique_ptr<Writer>(std::move(writer));
  }
  Result<std::unique_ptr<Reader>> reader(const EndpointConfig& config) override {
    const std::lock_guard lock(domain_.mutex_);
    auto reader = std::make_unique<FakeReader>(domain_, config, next_gid());
    domain_.readers_.push_back(reader.get());
    for (FakeWriter* writer : domain_.writers_) {
      if (writer->matches(*reader)) writer->replay(*reader);
    }
    return std::unique_ptr<Reader>(std::move(reader));
  }
  Graph graph() const override { return {}; }
  void on_event(EventHandler) override {}
  std::string explain() const override { return "fake\n"; }
  const ParticipantConfig& config() const override { return config_; }
  Gid gid() const override { return gid_; }

 private:
  Gid next_gid() {
    Gid gid = gid_;
    gid.bytes[15] = domain_.next_entity_++;
    return gid;
  }

  FakeDomain& domain_;
  const ParticipantConfig config_;
  const Gid gid_;
};

std::unique_ptr<Participant> FakeDomain::join(const ParticipantConfig& config) {
  const std::lock_guard lock(mutex_);
  Gid gid;
  gid.bytes[0] = 0xfa;
  gid.bytes[11] = next_participant_++;
  return std::make_unique<FakeParticipant>(*this, config, gid);
}

}  // namespace adit::testing
