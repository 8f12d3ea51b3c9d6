// The runtime over real DDS on loopback: every vendor with itself and with the other. Also that the data path stays
// free of allocations there. Each test has a domain of its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>

#include "components/runtime/component.hpp"
#include "components/runtime/process.hpp"
#include "components/runtime/testing/harness.hpp"
#include "idl/testing/allocation_counter.hpp"
#include "middleware/participant.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "std_msgs/msg/string.hpp"

namespace adit {
namespace {

using sensor_msgs::msg::PointCloud2;
using sensor_msgs::msg::PointField;
using std_msgs::msg::String;
using test::allocations_of_this_thread;
using testing::eventually;
using testing::Harness;

struct Pair {
  std::string sender, receiver;
};

// Domains 1 to 100 belong to tests/contract, 101 to 200 to other programs' tests.
std::uint32_t private_domain() {
  static std::uint32_t used = 0;
  return 201 + static_cast<std::uint32_t>(getpid()) % 15 * 2 + used++ % 2;  // 201..230
}

class Loopback : public ::testing::TestWithParam<Pair> {
 protected:
  void SetUp() override {
    const std::uint32_t domain = private_domain();
    sender_ = join(GetParam().sender, domain);
    receiver_ = join(GetParam().receiver, domain);
  }
  static std::unique_ptr<Participant> join(const std::string& vendor, std::uint32_t domain) {
    ParticipantConfig config;
    config.vendor = vendor;
    config.domain = domain;
    auto participant = open(config);
    EXPECT_TRUE(participant) << participant.error().message;
    return participant ? std::move(*participant) : nullptr;
  }
  std::unique_ptr<Participant> sender_, receiver_;
};

struct CloudSource final : Component {
  explicit CloudSource(std::size_t bytes, const Qos& qos) : cloud{*this, "cloud", qos}, size(bytes) {}
  bool publish(std::uint32_t number) {
    Loan<PointCloud2> loan = cloud.loan();
    loan->header.frame_id = "lidar_frame_with_a_long_name";
    loan->width = number;
    loan->fields.resize(4);
    for (PointField& field : loan->fields) field.name = "intensity";
    loan->data.resize(size);
    loan->data.mutable_data()[size - 1] = static_cast<std::uint8_t>(number);
    return cloud.publish(std::move(loan));
  }
  Output<PointCloud2> cloud;
  std::size_t size;
};

struct CloudSink final : Component {
  explicit CloudSink(const Qos& qos, int warm_up, int measured)
      : cloud{*this, "cloud", qos, Queue{4, WhenFull::drop_oldest},
              [this, warm_up, measured](const PointCloud2& message, const MessageInfo&) {
                if (message.data.empty() || message.data[message.data.size() - 1] != (message.width & 0xff)) ++wrong;
                if (!message.data.is_view()) ++copied;
                const int n = ++handled;
                if (n == warm_up) at_start = allocations_of_this_thread();
                if (n == warm_up + measured) allocated = allocations_of_this_thread() - at_start;
              }} {}
  std::atomic<int> handled{0}, wrong{0}, copied{0};
  std::uint64_t at_start = 0;
  std::atomic<std::uint64_t> allocated{~0ull};
  Input<PointCloud2> cloud;
};

void exchange(std::unique_ptr<Participant> from, std::unique_ptr<Participant> to, const Qos& qos) {
  constexpr int warm_up = 5, measured = 20;
  Harness sender(1, std::move(from)), receiver(1, std::move(to));
  auto& source = sender.make<CloudSource>("source", {}, std::size_t{4'000'000}, qos);
  auto& sink = receiver.make<CloudSink>("sink", {}, qos, warm_up, measured);
  sender.start();
  receiver.start();
  ASSERT_TRUE(eventually([&] { return source.cloud.stats().link.matched > 0 && sink.cloud.stats().link.matched > 0; },
                         std::chrono::seconds(20)));
  // Both sides have matched, but between vendors the first samples may still meet a peer that is not ready.
  int sent = 0;
  while (sink.handled == 0 && sent < 100) {
    source.publish(static_cast<std::uint32_t>(++sent));
    eventually([&] { return sink.handled > 0; }, std::chrono::milliseconds(100));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  const int first = sink.handled;
  ASSERT_GT(first, 0);
  for (int i = first + 1; i <= first + warm_up + measured; ++i) {
    source.publish(static_cast<std::uint32_t>(i));
    ASSERT_TRUE(eventually([&] { return sink.handled == i; }, std::chrono::seconds(5))) << "message " << i;
  }
  EXPECT_EQ(sink.wrong, 0);
  EXPECT_EQ(sink.copied, 0);
  EXPECT_EQ(sink.allocated, 0u);
  const InputStats stats = sink.cloud.stats();
  std::printf(
      "4 MB x %d (after %d to meet): handled %lu, lost %lu, dropped %lu, copied %d, allocations in the executor thread "
      "%lu\n",
      measured, sent, static_cast<unsigned long>(stats.handled), static_cast<unsigned long>(stats.link.lost),
      static_cast<unsigned long>(stats.dropped), sink.copied.load(), static_cast<unsigned long>(sink.allocated.load()));
}

TEST_P(Loopback, LargeCloudsArriveUncopiedAndWithoutAllocationsReliably) {
  exchange(std::move(sender_), std::move(receiver_), Qos::reliable(10));
}

TEST_P(Loopback, LargeCloudsArriveUncopiedAndWithoutAllocationsAsSensorData) {
  exchange(std::move(sender_), std::move(receiver_), Qos::sensor());
}

struct Latched final : Component {
  Output<String> text{*this, "text", Qos::latched(1)};
};

struct Reading final : Component {
  std::mutex mutex;
  std::vector<std::string> texts;
  Input<String> text{*this, "text", Qos::latched(1), Queue{}, [this](const String& message, const MessageInfo&) {
                       const std::lock_guard lock(mutex);
                       texts.push_back(message.data);
                     }};
  std::vector<std::string> seen() {
    const std::lock_guard lock(mutex);
    return texts;
  }
};

TEST_P(Loopback, ALateJoinerElsewhereGetsTheLatchedMessageAndALocalInputGetsItOnce) {
  Harness sender(1, std::move(sender_));
  auto& latched = sender.make<Latched>("latched");
  auto& local = sender.make<Reading>("local");
  sender.start();
  String message;
  for (const char* text : {"one", "two"}) {
    message.data = text;
    latched.text.publish(message);
  }
  Harness receiver(1, std::move(receiver_));
  auto& late = receiver.make<Reading>("late");
  receiver.start();
  ASSERT_TRUE(eventually([&] { return !late.seen().empty(); }, std::chrono::seconds(20)));
  EXPECT_THAT(late.seen(), ::testing::ElementsAre("two"));
  EXPECT_THAT(local.seen(), ::testing::ElementsAre("one", "two"));
}

INSTANTIATE_TEST_SUITE_P(Vendors, Loopback,
                         ::testing::Values(Pair{"fastdds", "fastdds"}, Pair{"cyclonedds", "cyclonedds"},
                                           Pair{"fastdds", "cyclonedds"}, Pair{"cyclonedds", "fastdds"}),
                         [](const auto& test) { return test.param.sender + "_to_" + test.param.receiver; });

}  // namespace
}  // namespace adit
