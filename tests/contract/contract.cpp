#include "tests/contract/contract.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <thread>

namespace adit::contract {

std::ostream& operator<<(std::ostream& out, const Pair& pair) {
  return out << pair.writer << " to " << pair.reader;
}

std::string name_of(const testing::TestParamInfo<Pair>& info) {
  return info.param.writer + "_to_" + info.param.reader;
}

std::vector<Pair> all_pairs() {
  std::vector<Pair> pairs;
  for (const auto writer : built_in_vendors()) {
    for (const auto reader : built_in_vendors()) pairs.push_back({std::string(writer), std::string(reader)});
  }
  return pairs;
}

PrivateDomain::PrivateDomain() {
  static std::uint32_t next = static_cast<std::uint32_t>(getpid()) * 7;
  for (int attempt = 0; attempt < 1000; ++attempt) {
    const std::uint32_t candidate = 1 + next++ % 100;
    const auto path = std::filesystem::temp_directory_path() / ("adit_test_domain_" + std::to_string(candidate));
    const int file = ::open(path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
    if (file < 0) continue;
    if (flock(file, LOCK_EX | LOCK_NB) == 0) {
      lock_ = file;
      id_ = candidate;
      return;
    }
    close(file);
    if (attempt >= 100) short_sleep();
  }
  ADD_FAILURE() << "no free domain between 1 and 100";
}

PrivateDomain::~PrivateDomain() {
  if (lock_ >= 0) close(lock_);
}

const TypeInfo payload_type{"adit_test/msg/Payload", "adit_test::msg::dds_::Payload_",
                            "RIHS01_0000000000000000000000000000000000000000000000000000000000000001", "uint8[] data",
                            1024};
const TypeInfo other_type{"adit_test/msg/Other", "adit_test::msg::dds_::Other_",
                          "RIHS01_0000000000000000000000000000000000000000000000000000000000000002", "uint8[] data",
                          1024};

std::size_t Payload::write(MutableBytes out) const {
  if (out.size() < size_ || size_ < smallest_payload) return 0;
  constexpr std::byte header[4] = {std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}};
  std::memcpy(out.data(), header, 4);
  std::memcpy(out.data() + 4, &number_, 8);
  for (std::size_t i = smallest_payload; i < size_; ++i) {
    out[i] = static_cast<std::byte>((i * 31 + (i >> 8) + number_) & 0xff);
  }
  return size_;
}

std::vector<std::byte> Payload::bytes() const {
  std::vector<std::byte> all(size_);
  write(all);
  return all;
}

std::uint64_t number_in(Bytes sample) {
  std::uint64_t number = 0;
  if (sample.size() >= smallest_payload) std::memcpy(&number, sample.data() + 4, 8);
  return number;
}

bool is_intact(Bytes sample, std::size_t size) {
  if (sample.size() < size || sample.size() > size + 3) return false;
  const std::vector<std::byte> expected = Payload(size, number_in(sample)).bytes();
  return std::memcmp(sample.data(), expected.data(), size) == 0;
}

void short_sleep() {
  std::this_thread::sleep_for(1ms);
}

Collector::Collector(Reader& reader) : reader_(reader) {
  reader_.on_data([this] {
    const std::lock_guard lock(mutex_);
    signalled_ = true;
    ready_.notify_one();
  });
}

Collector::~Collector() {
  reader_.on_data(nullptr);
}

bool Collector::wait_for(std::size_t count, Duration limit) {
  const auto end = std::chrono::steady_clock::now() + limit;
  for (;;) {
    Sample batch[16];
    while (const std::size_t taken = reader_.take(batch)) {
      for (std::size_t i = 0; i < taken; ++i) samples.push_back(std::move(batch[i]));
    }
    if (samples.size() >= count) return true;
    std::unique_lock lock(mutex_);
    if (!ready_.wait_until(lock, end, [this] { return signalled_; })) return false;
    signalled_ = false;
  }
}

EventLog::EventLog(Participant& participant) : participant_(participant) {
  participant_.on_event([this](const Event& event) {
    const std::lock_guard lock(mutex_);
    events_.push_back(event);
  });
}

EventLog::~EventLog() {
  participant_.on_event(nullptr);
}

std::vector<Event> EventLog::of(Event::Kind kind) const {
  const std::lock_guard lock(mutex_);
  std::vector<Event> found;
  for (const Event& event : events_) {
    if (event.kind == kind) found.push_back(event);
  }
  return found;
}

bool EventLog::wait_for(Event::Kind kind, std::size_t count, Duration limit) const {
  return wait_until([&] { return of(kind).size() >= count; }, limit);
}

ParticipantConfig Contract::participant_config(const std::string& vendor) const {
  ParticipantConfig config;
  config.vendor = vendor;
  config.domain = domain_.id();
  config.name = "contract";
  config.ros_distro = "none";
  return config;
}

std::unique_ptr<Participant> Contract::open_one(const std::string& vendor) {
  auto participant = open(participant_config(vendor));
  if (!participant) {
    ADD_FAILURE() << vendor << ": " << participant.error().message;
    return nullptr;
  }
  return std::move(*participant);
}

EndpointConfig Contract::endpoint(const std::string& topic, const Qos& qos, const TypeInfo& type) const {
  EndpointConfig config;
  config.topic = topic;
  config.type = &type;
  config.qos = qos;
  return config;
}

bool wait_for_match(const Writer& writer, const Reader& reader) {
  return wait_until([&] { return writer.stats().matched > 0 && reader.stats().matched > 0; });
}

Link::Link(Contract& test, const Pair& pair, const Qos& writer_qos, const Qos& reader_qos, const std::string& topic)
    : writer_side(test.open_one(pair.writer)), reader_side(test.open_one(pair.reader)) {
  if (!writer_side || !reader_side) return;
  reader = make_reader(*reader_side, test.endpoint(topic, reader_qos));
  writer = make_writer(*writer_side, test.endpoint(topic, writer_qos));
  if (!reader || !writer) return;
  EXPECT_TRUE(wait_for_match(*writer, *reader)) << "no match";
}

std::unique_ptr<Writer> make_writer(Participant& participant, const EndpointConfig& config) {
  auto made = participant.writer(config);
  if (made) return std::move(*made);
  ADD_FAILURE() << made.error().message;
  return nullptr;
}

std::unique_ptr<Reader> make_reader(Participant& participant, const EndpointConfig& config) {
  auto made = participant.reader(config);
  if (made) return std::move(*made);
  ADD_FAILURE() << made.error().message;
  return nullptr;
}

}  // namespace adit::contract
