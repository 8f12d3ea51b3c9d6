// A Participant in memory, for tests of decorators: what a writer publishes every reader of the topic can take.
#pragma once

#include <deque>
#include <memory>
#include <mutex>

#include "middleware/fault/fault_line.hpp"
#include "middleware/participant.hpp"

namespace adit::fault {

class FakeParticipant final : public Participant {
 public:
  Result<std::unique_ptr<Writer>> writer(const EndpointConfig& config) override {
    return std::unique_ptr<Writer>(std::make_unique<FakeWriter>(bus_, config));
  }
  Result<std::unique_ptr<Reader>> reader(const EndpointConfig& config) override {
    return std::unique_ptr<Reader>(std::make_unique<FakeReader>(bus_, config));
  }
  Graph graph() const override { return {}; }
  void on_event(EventHandler) override {}
  std::string explain() const override { return "in memory\n"; }
  const ParticipantConfig& config() const override { return config_; }
  Gid gid() const override { return {}; }

 private:
  class FakeReader;
  struct Bus {
    std::mutex mutex;
    std::vector<FakeReader*> readers;
  };

  class FakeReader final : public Reader {
   public:
    FakeReader(std::shared_ptr<Bus> bus, const EndpointConfig& config) : bus_(std::move(bus)), config_(config) {
      const std::lock_guard lock(bus_->mutex);
      bus_->readers.push_back(this);
    }
    ~FakeReader() override {
      const std::lock_guard lock(bus_->mutex);
      std::erase(bus_->readers, this);
    }
    void put(Bytes bytes, const MessageInfo& info) {
      const std::lock_guard lock(mutex_);
      samples_.push_back(make_sample(bytes, info));
      if (notify_) notify_();
    }
    std::size_t take(std::span<Sample> out) override {
      const std::lock_guard lock(mutex_);
      std::size_t count = 0;
      for (; count < out.size() && !samples_.empty(); ++count, samples_.pop_front()) {
        out[count] = std::move(samples_.front());
      }
      return count;
    }
    void on_data(Notify notify) override {
      const std::lock_guard lock(mutex_);
      notify_ = std::move(notify);
      if (notify_ && !samples_.empty()) notify_();
    }
    LinkStats stats() const override { return {}; }
    const EndpointConfig& config() const override { return config_; }
    Gid gid() const override { return {}; }

   private:
    const std::shared_ptr<Bus> bus_;
    const EndpointConfig config_;
    std::mutex mutex_;
    std::deque<Sample> samples_;
    Notify notify_;
  };

  class FakeWriter final : public Writer {
   public:
    FakeWriter(std::shared_ptr<Bus> bus, const EndpointConfig& config) : bus_(std::move(bus)), config_(config) {}
    using Writer::forward;
    using Writer::publish;
    Result<void> publish(const Encoder& message, Time source_time) override {
      std::vector<std::byte> bytes(message.size());
      message.write(bytes);
      return forward(bytes, source_time);
    }
    Result<void> forward(Bytes cdr, Time source_time) override {
      const std::lock_guard lock(bus_->mutex);
      MessageInfo info;
      info.source_time = source_time;
      info.sequence = ++sent_;
      for (auto* reader : bus_->readers) {
        if (reader->config().topic == config_.topic) reader->put(cdr, info);
      }
      return {};
    }
    bool has_remote_readers() const override { return true; }
    Result<void> wait_for_acknowledgements(Duration) override { return {}; }
    LinkStats stats() const override {
      LinkStats stats;
      stats.sent = sent_;
      return stats;
    }
    const EndpointConfig& config() const override { return config_; }
    Gid gid() const override { return {}; }

   private:
    const std::shared_ptr<Bus> bus_;
    const EndpointConfig config_;
    std::uint64_t sent_ = 0;
  };

  ParticipantConfig config_;
  std::shared_ptr<Bus> bus_ = std::make_shared<Bus>();
};

}  // namespace adit::fault
