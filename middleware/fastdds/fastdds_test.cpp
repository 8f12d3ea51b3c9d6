// What the contract suite does not ask of every vendor: this backend's limits, lifetimes, graph and refusals.
#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <thread>

#include "idl/testing/allocation_counter.hpp"
#include "middleware/vendor.hpp"

namespace adit {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr TypeInfo type{"adit_test/msg/Bytes", "adit_test::msg::dds_::Bytes_", "", "", 256};
constexpr TypeInfo other_type{"adit_test/msg/Other", "adit_test::msg::dds_::Other_", "", "", 256};

template <class Condition>
bool wait_until(Condition condition, Duration limit = 10s) {
  const auto end = std::chrono::steady_clock::now() + limit;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

class Numbered final : public Encoder {
 public:
  Numbered(std::uint32_t number, std::size_t size = 64, std::uint8_t representation = 1)
      : number_(number), size_(size), representation_(representation) {}
  std::size_t size() const override { return size_; }
  std::size_t write(MutableBytes out) const override {
    if (out.size() < size_) return 0;
    std::memset(out.data(), static_cast<int>(number_ & 0xff), size_);
    const std::byte header[4] = {std::byte{0}, std::byte{representation_}, std::byte{0}, std::byte{0}};
    std::memcpy(out.data(), header, 4);
    std::memcpy(out.data() + 4, &number_, 4);
    return size_;
  }

 private:
  std::uint32_t number_;
  std::size_t size_;
  std::uint8_t representation_;
};

std::uint32_t number_in(const Sample& sample) {
  std::uint32_t number = 0;
  std::memcpy(&number, sample.bytes().data() + 4, 4);
  return number;
}

class FastDds : public testing::Test {
 protected:
  ParticipantConfig config() const {
    ParticipantConfig config;
    config.vendor = "fastdds";
    config.domain = 101 + static_cast<std::uint32_t>(getpid()) % 100;
    return config;
  }
  Result<std::unique_ptr<Participant>> try_open(const ParticipantConfig& config) {
    return (*load_vendor("fastdds"))->open(config, "enclave=/;");
  }
  std::unique_ptr<Participant> open_one() {
    auto participant = try_open(config());
    EXPECT_TRUE(participant) << participant.error().message;
    return participant ? *std::move(participant) : nullptr;
  }
  // One name a process, so that processes that share a domain by chance do not meet.
  EndpointConfig endpoint(const Qos& qos, const TypeInfo& info = type) const {
    EndpointConfig config;
    config.topic = "rt/fastdds_test_" + std::to_string(getpid());
    config.type = &info;
    config.qos = qos;
    return config;
  }
  Error refusal(const ParticipantConfig& config) {
    const auto participant = try_open(config);
    return participant ? Error{ErrorCode::internal, "opened"} : participant.error();
  }
};

bool matched(const Writer& writer, const Reader& reader) {
  return wait_until([&] { return writer.stats().matched > 0 && reader.stats().matched > 0; });
}

TEST_F(FastDds, SamplesOutliveReaderAndParticipant) {
  std::vector<Sample> kept(4);
  {
    const auto sender = open_one(), receiver = open_one();
    const auto writer = *sender->writer(endpoint(Qos::reliable()));
    auto reader = *receiver->reader(endpoint(Qos::reliable()));
    ASSERT_TRUE(matched(*writer, *reader));
    for (std::uint32_t n = 0; n < 4; ++n) ASSERT_TRUE(writer->publish(Numbered(n, 100'000)));
    std::size_t got = 0;
    ASSERT_TRUE(wait_until([&] { return (got += reader->take(std::span(kept).subspan(got))) == 4; }));
    reader.reset();
    for (std::uint32_t n = 4; n < 40; ++n) ASSERT_TRUE(writer->publish(Numbered(n, 100'000)));
  }
  for (std::uint32_t n = 0; n < 4; ++n) {
    EXPECT_EQ(number_in(kept[n]), n);
    for (std::size_t i = 8; i < 100'000; ++i) ASSERT_EQ(kept[n].bytes()[i], static_cast<std::byte>(n));
  }
  std::thread([&] { kept.clear(); }).join();  // the last one leaves the domain, on whichever thread
}

TEST_F(FastDds, WhatIsNotTakenIsOverwrittenAndCounted) {
  const auto sender = open_one(), receiver = open_one();
  const auto writer = *sender->writer(endpoint(Qos::reliable(100)));
  const auto reader = *receiver->reader(endpoint(Qos::reliable(5)));
  ASSERT_TRUE(matched(*writer, *reader));
  for (std::uint32_t n = 1; n <= 50; ++n) ASSERT_TRUE(writer->publish(Numbered(n)));
  ASSERT_TRUE(writer->wait_for_acknowledgements(10s));
  ASSERT_TRUE(wait_until([&] { return reader->stats().overwritten == 45; }));
  Sample out[10];
  ASSERT_EQ(reader->take(out), 5u);
  EXPECT_EQ(number_in(out[0]), 46u);
  EXPECT_EQ(number_in(out[4]), 50u);
  EXPECT_EQ(reader->stats().lost, 0u);
  EXPECT_EQ(reader->stats().received, 5u);
}

TEST_F(FastDds, AHoarderGetsNoMoreThanTheLimitAndNobodyBlocks) {
  const auto sender = open_one(), receiver = open_one();
  const auto writer = *sender->writer(endpoint(Qos::reliable(10)));
  const auto reader = *receiver->reader(endpoint(Qos::reliable(10)));
  ASSERT_TRUE(matched(*writer, *reader));
  std::vector<Sample> hoard;
  for (std::uint32_t n = 1; n <= 500; ++n) {
    ASSERT_TRUE(writer->publish(Numbered(n)));
    Sample out[4];
    const std::size_t got = reader->take(out);
    for (std::size_t i = 0; i < got; ++i) hoard.push_back(std::move(out[i]));
  }
  ASSERT_TRUE(writer->wait_for_acknowledgements(10s));
  ASSERT_TRUE(wait_until([&] { return reader->stats().received + reader->stats().overwritten == 490; }));
  EXPECT_EQ(hoard.size(), 74u);  // 64 and the depth
  for (std::uint32_t i = 0; i < hoard.size(); ++i) EXPECT_EQ(number_in(hoard[i]), i + 1);
  hoard.clear();
  Sample out[16];
  EXPECT_EQ(reader->take(out), 10u);
  EXPECT_EQ(number_in(out[9]), 500u);
  EXPECT_EQ(reader->stats().lost, 0u);
}

TEST_F(FastDds, KeepAllKeepsWhatExceedsItsQueueInOrder) {
  const auto sender = open_one(), receiver = open_one();
  auto large = endpoint(Qos::reliable(0));
  TypeInfo cloud = type;
  cloud.typical_size = 4 << 20;  // a queue of 64 samples; the others wait in the vendor's history
  large.type = &cloud;
  const auto writer = *sender->writer(large);
  const auto reader = *receiver->reader(large);
  ASSERT_TRUE(matched(*writer, *reader));
  constexpr std::uint32_t count = 120;
  for (std::uint32_t n = 1; n <= count; ++n) {
    const auto sent = writer->publish(Numbered(n));
    ASSERT_TRUE(sent) << sent.error().message;
  }
  std::uint32_t next = 1;
  EXPECT_TRUE(wait_until([&] {
    Sample out[16];
    const std::size_t got = reader->take(out);
    for (std::size_t i = 0; i < got; ++i) EXPECT_EQ(number_in(out[i]), next++);
    return next == count + 1;
  }));
  EXPECT_EQ(reader->stats().lost + reader->stats().overwritten, 0u);
}

TEST_F(FastDds, IgnoreLocalDropsOwnSamplesWithoutATrace) {
  const auto own = open_one(), other = open_one();
  EndpointConfig deaf_to_own = endpoint(Qos::reliable());
  deaf_to_own.ignore_local = true;
  const auto own_writer = *own->writer(endpoint(Qos::reliable()));
  const auto reader = *own->reader(deaf_to_own);
  ASSERT_TRUE(matched(*own_writer, *reader));
  EXPECT_FALSE(own_writer->has_remote_readers());
  std::atomic<int> calls{0};
  reader->on_data([&] { ++calls; });
  for (std::uint32_t n = 0; n < 30; ++n) ASSERT_TRUE(own_writer->publish(Numbered(n)));
  ASSERT_TRUE(own_writer->wait_for_acknowledgements(10s));
  EXPECT_EQ(calls, 0);

  const auto other_writer = *other->writer(endpoint(Qos::reliable()));
  ASSERT_TRUE(wait_until([&] { return reader->stats().matched == 2 && other_writer->has_remote_readers(); }));
  ASSERT_TRUE(other_writer->publish(Numbered(77)));
  Sample out[4];
  ASSERT_TRUE(wait_until([&] { return reader->take(out) == 1; }));
  EXPECT_EQ(number_in(out[0]), 77u);
  EXPECT_EQ(reader->stats().overwritten + reader->stats().lost + reader->stats().rejected, 0u);
  reader->on_data(nullptr);
}

TEST_F(FastDds, WhatIsNoPlainCdrIsRejectedAndCounted) {
  const auto sender = open_one(), receiver = open_one();
  const auto writer = *sender->writer(endpoint(Qos::reliable()));
  const auto reader = *receiver->reader(endpoint(Qos::reliable()));
  ASSERT_TRUE(matched(*writer, *reader));
  constexpr std::uint8_t xcdr2 = 7;
  ASSERT_TRUE(writer->publish(Numbered(1, 64, xcdr2)));
  ASSERT_TRUE(writer->publish(Numbered(2)));
  Sample out[4];
  ASSERT_TRUE(wait_until([&] { return reader->take(out) == 1; }));
  EXPECT_EQ(number_in(out[0]), 2u);
  EXPECT_EQ(reader->stats().rejected, 1u);
  EXPECT_EQ(reader->stats().lost, 0u);
}

TEST_F(FastDds, TakingAllocatesNothingOnceWarm) {
  const auto sender = open_one(), receiver = open_one();
  const auto writer = *sender->writer(endpoint(Qos::reliable()));
  const auto reader = *receiver->reader(endpoint(Qos::reliable()));
  ASSERT_TRUE(matched(*writer, *reader));
  std::size_t published = 0, taken = 0;
  for (std::uint32_t n = 1; n <= 200; ++n) {
    const Numbered message(n, 5000);
    const std::size_t before_publish = test::allocations_of_this_thread();
    const auto sent = writer->publish(message);
    if (n > 100) published += test::allocations_of_this_thread() - before_publish;
    ASSERT_TRUE(sent);
    Sample out[2];
    std::size_t got = 0;
    while (got == 0) {
      const std::size_t before_take = test::allocations_of_this_thread();
      got = reader->take(out);
      out[0].reset();
      if (n > 100) taken += test::allocations_of_this_thread() - before_take;
      std::this_thread::yield();
    }
  }
  EXPECT_EQ(taken, 0u);
  RecordProperty("allocations_in_100_publishes", static_cast<int>(published));
  std::printf("allocations in 100 warm publishes: %zu\n", published);
}

TEST_F(FastDds, GraphShowsOwnAndRemoteParticipantsAndEndpoints) {
  ParticipantConfig named = config();
  named.name = "camera_process";
  const auto local = open_one();
  const auto remote = *try_open(named);
  EndpointConfig writer_config = endpoint(Qos::latched(3));
  writer_config.user_data = "typehash=RIHS01_ab;";
  writer_config.qos.deadline = 250ms;
  const auto writer = *remote->writer(writer_config);
  const auto reader = *local->reader(endpoint(Qos::sensor()));
  const auto find = [&](const Gid& gid) {
    for (const auto& info : local->graph().endpoints) {
      if (info.gid == gid) return std::optional(info);
    }
    return std::optional<EndpointInfo>();
  };
  ASSERT_TRUE(wait_until([&] { return find(writer->gid()).has_value(); }));
  const EndpointInfo seen = *find(writer->gid());
  EXPECT_TRUE(seen.is_writer);
  EXPECT_EQ(seen.dds_topic, writer_config.topic);
  EXPECT_EQ(seen.dds_type, type.dds_name);
  EXPECT_EQ(seen.type_hash, "RIHS01_ab");
  EXPECT_EQ(seen.qos.durability, Qos::Durability::transient_local);
  EXPECT_EQ(seen.qos.deadline, Duration(250ms));
  EXPECT_FALSE(seen.history_known);
  ASSERT_TRUE(find(reader->gid()).has_value());
  EXPECT_EQ(find(reader->gid())->qos, Qos::sensor());

  std::optional<ParticipantInfo> other;
  for (const auto& info : local->graph().participants) {
    if (info.gid == remote->gid()) other = info;
    EXPECT_EQ(info.local, info.gid == local->gid());
  }
  ASSERT_TRUE(other);
  EXPECT_EQ(other->name, "camera_process");
  EXPECT_EQ(other->enclave, "/");
  EXPECT_EQ(other->vendor, "Fast DDS");
}

TEST_F(FastDds, MismatchNamesEveryPolicyAndAWrongTypeWhicheverSideComesFirst) {
  for (const bool reader_first : {true, false}) {
    const auto local = open_one(), remote = open_one();
    std::mutex mutex;
    std::vector<Event> events;
    local->on_event([&](const Event& event) {
      const std::lock_guard lock(mutex);
      if (event.kind == Event::Kind::qos_mismatch) events.push_back(event);
    });
    Qos wanted = Qos::latched();
    wanted.deadline = 10ms;
    std::unique_ptr<Reader> reader;
    if (reader_first) reader = *local->reader(endpoint(wanted, other_type));
    const auto writer = *remote->writer(endpoint(Qos::sensor()));
    if (!reader_first) {
      ASSERT_TRUE(wait_until([&] { return !local->graph().endpoints.empty(); }));
      reader = *local->reader(endpoint(wanted, other_type));
    }
    ASSERT_TRUE(wait_until([&] {
      const std::lock_guard lock(mutex);
      return !events.empty();
    }));
    local->on_event(nullptr);
    ASSERT_EQ(events.size(), 1u);
    EXPECT_EQ(events[0].local, reader->gid());
    EXPECT_EQ(events[0].remote, writer->gid());
    std::vector<std::string> policies;
    for (const auto& mismatch : events[0].mismatches) policies.push_back(mismatch.policy);
    EXPECT_THAT(policies, testing::ElementsAre("reliability", "durability", "deadline", "type"));
    EXPECT_THAT(events[0].text, HasSubstr("remedy"));
  }
}

TEST_F(FastDds, ThirtyParticipantsFindEachOther) {
  std::vector<std::unique_ptr<Participant>> all;
  ParticipantConfig small = config();
  small.shared_memory = false;
  for (int i = 0; i < 30; ++i) {
    auto participant = try_open(small);
    ASSERT_TRUE(participant) << participant.error().message;
    all.push_back(*std::move(participant));
  }
  for (const auto& participant : all) {
    ASSERT_TRUE(wait_until(
        [&] {
          std::size_t found = 0;
          const Graph graph = participant->graph();
          for (const auto& known : all) {
            for (const auto& info : graph.participants) found += info.gid == known->gid();
          }
          return found == all.size();
        },
        30s));
  }
}

TEST_F(FastDds, TheHighestDomainOpens) {
  ParticipantConfig highest = config();
  highest.domain = 232;
  const auto participant = try_open(highest);
  ASSERT_TRUE(participant) << participant.error().message;
}

TEST_F(FastDds, ExplainShowsWhatIsInForce) {
  const auto participant = open_one();
  const std::string text = participant->explain();
  for (const char* part : {"127.0.0.1", "receive buffer", "granted", "data-sharing: off", "domain"}) {
    EXPECT_THAT(text, HasSubstr(part));
  }
}

TEST_F(FastDds, RefusalsSayWhatToDo) {
  ParticipantConfig wrong = config();
  wrong.network = "nosuch0";
  EXPECT_EQ(refusal(wrong).code, ErrorCode::not_found);
  EXPECT_THAT(refusal(wrong).message, testing::AllOf(HasSubstr("nosuch0"), HasSubstr("lo (127.0.0.1)")));

  wrong = config();
  wrong.peers = {"192.0.2.1"};
  EXPECT_EQ(refusal(wrong).code, ErrorCode::invalid_argument);
  EXPECT_THAT(refusal(wrong).message, HasSubstr("name the interface"));

  wrong = config();
  wrong.security = SecurityConfig{"/nonexistent/keystore", "/robot"};
  EXPECT_EQ(refusal(wrong).code, ErrorCode::unavailable);
  EXPECT_THAT(refusal(wrong).message, HasSubstr("/nonexistent/keystore/enclaves/robot/"));

  setenv("ROS_DISCOVERY_SERVER", "127.0.0.1:11811", 1);
  EXPECT_THAT(refusal(config()).message, HasSubstr("unset it"));
  unsetenv("ROS_DISCOVERY_SERVER");

  const auto participant = open_one();
  const auto first = participant->writer(endpoint(Qos::reliable()));
  ASSERT_TRUE(first);
  const auto second = participant->reader(endpoint(Qos::reliable(), other_type));
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::incompatible);
  Qos impossible;
  impossible.deadline = -1ms;
  EXPECT_EQ(participant->writer(endpoint(impossible)).error().code, ErrorCode::invalid_argument);
}

}  // namespace
}  // namespace adit
