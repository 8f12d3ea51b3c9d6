#include "components/runtime/offline_runner.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"
#include "components/runtime/testing/recording.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "std_msgs/msg/int64.hpp"

namespace adit {
namespace {

using testing::Recording;

using namespace std::chrono_literals;
using sensor_msgs::msg::Image;
using std_msgs::msg::Int64;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Burst of three a message; two chained components and a timer see the same time.
class Burst final : public Component {
  Output<Int64> out_{*this, "burst", Qos::reliable(1)};
  Input<Image> in_{*this, "image", Qos::sensor(), Queue{1}, [this](const Image& image, const MessageInfo& info) {
                     if (image.data.size() == 13) throw std::runtime_error("unlucky");
                     for (std::int64_t i = 0; i < 3; ++i) {
                       Int64 message;
                       message.data = info.source_time.time_since_epoch() / 1ms * 10 + i + image.data.size() * 1000000;
                       out_.publish(message);
                     }
                   }};
};
ADIT_COMPONENT(Burst, "test_burst");

class Sum final : public Component {
  std::int64_t sum_ = 0;
  Output<Int64> out_{*this, "sum", Qos::reliable(1)};
  Input<Int64> in_{*this, "burst", Qos::reliable(1), Queue{1},
                   [this](const Int64& message, const MessageInfo&) { sum_ += message.data; }};
  Timer timer_{*this, "tick", 100ms, [this](const TimerTick& tick) {
                 Int64 message;
                 message.data = sum_ + (tick.now.time_since_epoch() / 1ms) * 1'000'000'000;
                 out_.publish(message);
               }};
};
ADIT_COMPONENT(Sum, "test_sum");

OfflineMessage image(Duration stamp, std::size_t size) {
  auto message = std::make_shared<Image>();
  message->data.resize(size);
  return offline_message<Image>("/image", Time(stamp), message);
}

std::vector<ComponentConfig> burst_and_sum() {
  std::vector<ComponentConfig> configs(2);
  configs[0].type = configs[0].name = "test_burst";
  configs[1].type = configs[1].name = "test_sum";
  for (ComponentConfig& config : configs) config.log_level = LogLevel::off;
  return configs;
}

struct Outcome {
  std::vector<std::byte> bytes;
  std::vector<std::int64_t> sums;
  OfflineStats stats;
};

Outcome run(std::vector<OfflineMessage> messages) {
  auto runner = OfflineRunner::build(burst_and_sum());
  Outcome outcome;
  EXPECT_TRUE(runner);
  (*runner)->tap_cdr("/burst",
                     [&](Bytes cdr, Time) { outcome.bytes.insert(outcome.bytes.end(), cdr.begin(), cdr.end()); });
  (*runner)->tap("/sum", [&](const ErasedType&, const std::shared_ptr<const void>& message, const MessageInfo&) {
    outcome.sums.push_back(static_cast<const Int64*>(message.get())->data);
  });
  Recording source(std::move(messages));
  const auto stats = (*runner)->run(source);
  EXPECT_TRUE(stats) << stats.error().message;
  if (stats) outcome.stats = *stats;
  return outcome;
}

TEST(OfflineRunner, HandlesEachMessageToTheEndAndFiresTimersInBetween) {
  const Outcome outcome = run({image(1000ms, 1), image(1050ms, 1), image(1300ms, 1)});
  const std::int64_t first = 3 * (1'000'000 + 10'000) + 3, second = 3 * (1'000'000 + 10'500) + 3;
  EXPECT_THAT(outcome.sums, ElementsAre(first + second + 1100'000'000'000, first + second + 1200'000'000'000,
                                        first + second + 1300'000'000'000));
  EXPECT_EQ(outcome.stats.delivered, 3u);
}

TEST(OfflineRunner, IsBitIdenticalFromRunToRun) {
  std::vector<OfflineMessage> messages;
  for (int i = 0; i < 500; ++i) messages.push_back(image(i * 7ms, static_cast<std::size_t>(14 + i * 31 % 97)));
  const Outcome one = run(messages), two = run(messages);
  EXPECT_EQ(one.bytes, two.bytes);
  EXPECT_EQ(one.sums, two.sums);
  EXPECT_EQ(one.sums.size(), 34u);
  EXPECT_FALSE(one.bytes.empty());
}

TEST(OfflineRunner, TakesSerializedMessages) {
  Image message;
  message.data.resize(5);
  std::vector<std::byte> cdr(encoded_size(message));
  encode(message, cdr);
  OfflineMessage serialized;
  serialized.topic = "/image";
  serialized.stamp = Time(1000ms);
  serialized.cdr = cdr;
  OfflineMessage unheard = serialized;
  unheard.topic = "/other";
  const Outcome from_cdr = run({serialized, unheard});
  const Outcome from_object = run({image(1000ms, 5)});
  EXPECT_EQ(from_cdr.bytes, from_object.bytes);
  EXPECT_EQ(from_cdr.stats.unheard, 1u);
}

TEST(OfflineRunner, TimeNeverGoesBack) {
  const Outcome outcome = run({image(1000ms, 1), image(900ms, 1), image(1100ms, 1)});
  EXPECT_EQ(outcome.stats.out_of_order, 1u);
  EXPECT_EQ(outcome.stats.delivered, 3u);
}

TEST(OfflineRunner, EndsWithAnErrorWhenAComponentThrowsOrAMessageIsBroken) {
  auto runner = OfflineRunner::build(burst_and_sum());
  Recording unlucky({image(1ms, 13)});
  const auto thrown = (*runner)->run(unlucky);
  ASSERT_FALSE(thrown);
  EXPECT_THAT(thrown.error().message, HasSubstr("unlucky"));

  auto another = OfflineRunner::build(burst_and_sum());
  const std::vector<std::byte> bad(6);
  OfflineMessage broken;
  broken.topic = "/image";
  broken.cdr = bad;
  Recording source({broken});
  const auto refused = (*another)->run(source);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("/image: a message cannot be decoded: "));
}

}  // namespace
}  // namespace adit
