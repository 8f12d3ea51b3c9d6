// Faults on real links: each vendor, one domain of this process's own.
#include <gmock/gmock.h>
#include <unistd.h>

#include <cstring>
#include <thread>

#include "middleware/fault/faulty_participant.hpp"
#include "middleware/vendor.hpp"

namespace adit {
namespace {

using namespace std::chrono_literals;

constexpr TypeInfo type{"std_msgs/msg/String", "std_msgs::msg::dds_::String_", "", "", 64};

template <class Condition>
bool wait_until(Condition condition) {
  const auto end = std::chrono::steady_clock::now() + 10s;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

class FaultVendor : public testing::TestWithParam<std::string> {
 protected:
  std::unique_ptr<Participant> open_one() {
    ParticipantConfig config;
    config.vendor = GetParam();
    config.domain = 101 + static_cast<std::uint32_t>(getpid()) % 100;
    auto participant = (*load_vendor(GetParam()))->open(config, {});
    EXPECT_TRUE(participant) << participant.error().message;
    return participant ? *std::move(participant) : nullptr;
  }
  EndpointConfig endpoint() const {
    EndpointConfig config;
    config.topic = "fault_" + std::to_string(getpid());
    config.type = &type;
    config.qos = Qos::reliable(100);
    return config;
  }
};
INSTANTIATE_TEST_SUITE_P(Vendors, FaultVendor, testing::ValuesIn([] {
                           std::vector<std::string> names;
                           for (const auto name : built_in_vendors()) names.emplace_back(name);
                           return names;
                         }()),
                         [](const auto& instance) { return instance.param; });

TEST_P(FaultVendor, DropAndDuplicateOnARealLink) {
  FaultRule rule;
  rule.drop_every = 4;
  rule.duplicate = 1.0;
  auto sender = open_one();
  auto bare = open_one();
  ASSERT_TRUE(sender && bare);
  const auto receiver = wrap_with_faults(std::move(bare), {.seed = 3, .rules = {rule}});
  const auto reader = receiver->reader(endpoint());
  const auto writer = sender->writer(endpoint());
  ASSERT_TRUE(reader && writer);
  ASSERT_TRUE(wait_until([&] { return (*writer)->stats().matched > 0 && (*reader)->stats().matched > 0; }));

  std::vector<std::byte> message(40);
  message[1] = std::byte{1};
  for (int i = 0; i < 40; ++i) ASSERT_TRUE((*writer)->forward(message));
  std::size_t got = 0;
  EXPECT_TRUE(wait_until([&] {
    Sample out[16];
    while (const std::size_t n = (*reader)->take(out)) got += n;
    return receiver->counters("*", FaultSide::reading).samples == 40;
  }));
  EXPECT_EQ(got, 60u);  // 10 of 40 dropped, 30 doubled
  EXPECT_EQ(receiver->counters("*", FaultSide::reading).dropped, 10u);
}

TEST_P(FaultVendor, SamplesOfAWriterMutedByHandAreNotSent) {
  auto bare = open_one();
  auto other = open_one();
  ASSERT_TRUE(bare && other);
  FaultRule rule;
  rule.side = FaultSide::writing;
  const auto sender = wrap_with_faults(std::move(bare), {.seed = 3, .rules = {rule}});
  const auto writer = sender->writer(endpoint());
  const auto reader = other->reader(endpoint());
  ASSERT_TRUE(reader && writer);
  ASSERT_TRUE(wait_until([&] { return (*writer)->stats().matched > 0 && (*reader)->stats().matched > 0; }));
  std::vector<std::byte> message(40);
  message[1] = std::byte{1};
  sender->mute("*", FaultSide::writing);
  ASSERT_TRUE((*writer)->forward(message));
  sender->unmute("*", FaultSide::writing);
  message.resize(44);
  ASSERT_TRUE((*writer)->forward(message));
  Sample out[4];
  std::size_t got = 0;
  ASSERT_TRUE(wait_until([&] { return (got = (*reader)->take(out)) > 0; }));
  EXPECT_EQ(got, 1u);
  EXPECT_EQ(out[0].bytes().size(), 44u);
  EXPECT_EQ((*writer)->stats().sent, 1u);
}

}  // namespace
}  // namespace adit
