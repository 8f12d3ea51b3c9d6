// What the contract tests are written with: a private domain, two participants of given vendors, numbered messages.
#pragma once

#include <gmock/gmock.h>

#include <condition_variable>
#include <mutex>

#include "middleware/participant.hpp"

namespace adit::contract {

using namespace std::chrono_literals;

// Who writes and who reads.
struct Pair {
  std::string writer;
  std::string reader;
};
std::ostream& operator<<(std::ostream& out, const Pair& pair);
std::string name_of(const testing::TestParamInfo<Pair>& info);
// Every ordered pair of the vendors of this build.
std::vector<Pair> all_pairs();

// A domain id from 1 to 100 that no other test process of this host uses at the moment.
class PrivateDomain {
 public:
  PrivateDomain();
  ~PrivateDomain();
  PrivateDomain(const PrivateDomain&) = delete;
  PrivateDomain& operator=(const PrivateDomain&) = delete;
  std::uint32_t id() const { return id_; }

 private:
  int lock_ = -1;
  std::uint32_t id_ = 0;
};

extern const TypeInfo payload_type;
extern const TypeInfo other_type;

// A sample of `size` bytes: CDR_LE header, the number, then bytes that depend on number and position.
class Payload final : public Encoder {
 public:
  Payload(std::size_t size, std::uint64_t number) : size_(size), number_(number) {}
  std::size_t size() const override { return size_; }
  std::size_t write(MutableBytes out) const override;
  std::vector<std::byte> bytes() const;

 private:
  std::size_t size_;
  std::uint64_t number_;
};
constexpr std::size_t smallest_payload = 12;
std::uint64_t number_in(Bytes sample);
// Every byte is as Payload(size, number_in(sample)) wrote it; up to 3 bytes of padding may follow.
bool is_intact(Bytes sample, std::size_t size);

// Polls until `condition` holds; false after `limit`.
template <class Condition>
bool wait_until(Condition condition, Duration limit = 10s);
void short_sleep();

// Takes samples as they come, woken by on_data.
class Collector {
 public:
  explicit Collector(Reader& reader);
  ~Collector();
  // Takes until there are `count` samples in all, or `limit` has passed without.
  bool wait_for(std::size_t count, Duration limit = 10s);
  std::vector<Sample> samples;

 private:
  Reader& reader_;
  std::mutex mutex_;
  std::condition_variable ready_;
  bool signalled_ = false;
};

// Keeps every event of a participant. Thread-safe.
class EventLog {
 public:
  explicit EventLog(Participant& participant);
  ~EventLog();
  std::vector<Event> of(Event::Kind kind) const;
  bool wait_for(Event::Kind kind, std::size_t count = 1, Duration limit = 10s) const;

 private:
  Participant& participant_;
  mutable std::mutex mutex_;
  std::vector<Event> events_;
};

class Contract : public testing::TestWithParam<Pair> {
 public:
  // Opens a participant of this test's domain; fails the test when it cannot.
  std::unique_ptr<Participant> open_one(const std::string& vendor);
  ParticipantConfig participant_config(const std::string& vendor) const;
  EndpointConfig endpoint(const std::string& topic, const Qos& qos, const TypeInfo& type = payload_type) const;

 protected:
  PrivateDomain domain_;
};

// Null, and a failure of the test, when it is refused.
std::unique_ptr<Writer> make_writer(Participant& participant, const EndpointConfig& config);
std::unique_ptr<Reader> make_reader(Participant& participant, const EndpointConfig& config);

// A writer and a reader of one topic, each with a participant of its own, matched.
struct Link {
  Link(Contract& test, const Pair& pair, const Qos& writer_qos, const Qos& reader_qos,
       const std::string& topic = "contract");
  std::unique_ptr<Participant> writer_side;
  std::unique_ptr<Participant> reader_side;
  std::unique_ptr<Writer> writer;
  std::unique_ptr<Reader> reader;
};
bool wait_for_match(const Writer& writer, const Reader& reader);

template <class Condition>
bool wait_until(Condition condition, Duration limit) {
  const auto end = std::chrono::steady_clock::now() + limit;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    short_sleep();
  }
  return true;
}

}  // namespace adit::contract
