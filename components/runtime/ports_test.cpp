// Messages from Output to Input: identity, queues, latching, decoding, refusals.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <condition_variable>
#include <mutex>
#include <vector>

#include "components/runtime/component.hpp"
#include "components/runtime/testing/fake_participant.hpp"
#include "components/runtime/testing/harness.hpp"
#include "middleware/participant.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "std_msgs/msg/int32.hpp"

namespace adit {
namespace {

using sensor_msgs::msg::PointCloud2;
using std_msgs::msg::Int32;
using ::testing::ElementsAre;
using testing::eventually;
using testing::FakeDomain;
using testing::Harness;

struct Talker final : Component {
  explicit Talker(const Qos& qos = Qos::reliable(10)) : output{*this, "numbers", qos} {}
  bool say(int number) {
    Int32 message;
    message.data = number;
    return output.publish(message);
  }
  Output<Int32> output;
};

struct Listener final : Component {
  explicit Listener(const Queue& queue = {}, const Qos& qos = Qos::reliable(10))
      : input{*this, "numbers", qos, queue, [this](const Int32& message, const MessageInfo& info) {
                heard.push_back(message.data);
                sequences.push_back(info.sequence);
              }} {}
  std::vector<int> heard;
  std::vector<std::uint64_t> sequences;
  Input<Int32> input;
};

struct CloudSource final : Component {
  Output<PointCloud2> output{*this, "cloud", Qos::sensor()};
};

struct CloudSink final : Component {
  std::vector<std::shared_ptr<const PointCloud2>> clouds;
  Input<PointCloud2> input{
      *this, "cloud", Qos::sensor(), Queue{4, WhenFull::drop_oldest},
      [this](std::shared_ptr<const PointCloud2> cloud, const MessageInfo&) { clouds.push_back(std::move(cloud)); }};
};

TEST(Ports, MessagesArriveInOrderWithTheirSequence) {
  Harness harness;
  auto& talker = harness.make<Talker>("talker");
  auto& listener = harness.make<Listener>("listener");
  harness.start();
  for (int i = 1; i <= 3; ++i) EXPECT_TRUE(talker.say(i));
  harness.step();
  EXPECT_THAT(listener.heard, ElementsAre(1, 2, 3));
  EXPECT_THAT(listener.sequences, ElementsAre(1, 2, 3));
}

TEST(Ports, EveryLocalInputGetsTheVeryObjectThatWasPublished) {
  Harness harness;
  auto& source = harness.make<CloudSource>("source");
  auto& one = harness.make<CloudSink>("one");
  auto& two = harness.make<CloudSink>("two");
  harness.start();
  Loan<PointCloud2> loan = source.output.loan();
  const PointCloud2* const published = &*loan;
  loan->data.resize(1000);
  source.output.publish(std::move(loan));
  harness.step();
  ASSERT_EQ(one.clouds.size(), 1u);
  ASSERT_EQ(two.clouds.size(), 1u);
  EXPECT_EQ(one.clouds[0].get(), published);
  EXPECT_EQ(two.clouds[0].get(), published);
}

TEST(Ports, AFullQueueDropsWhatItsPolicySaysAndCounts) {
  Harness harness;
  auto& talker = harness.make<Talker>("talker");
  auto& newest = harness.make<Listener>("newest", {}, Queue{2, WhenFull::drop_oldest});
  auto& oldest = harness.make<Listener>("oldest", {}, Queue{2, WhenFull::drop_newest});
  harness.start();
  for (int i = 1; i <= 5; ++i) talker.say(i);
  harness.step();
  EXPECT_THAT(newest.heard, ElementsAre(4, 5));
  EXPECT_THAT(oldest.heard, ElementsAre(1, 2));
  EXPECT_EQ(newest.input.stats().dropped, 3u);
  EXPECT_EQ(oldest.input.stats().dropped, 3u);
  EXPECT_EQ(oldest.input.stats().handled, 2u);
}

TEST(Ports, BlockHoldsThePublisherBackUntilThereIsRoom) {
  Harness harness(1);
  Qos patient = Qos::reliable(10);
  patient.max_blocking = std::chrono::seconds(10);
  auto& talker = harness.make<Talker>("talker", {}, patient);
  auto& listener = harness.make<Listener>("listener", {}, Queue{2, WhenFull::block});
  harness.start();
  for (int i = 0; i < 1000; ++i) talker.say(i);
  ASSERT_TRUE(eventually([&] { return listener.input.stats().handled == 1000; }));
  EXPECT_EQ(listener.input.stats().dropped, 0u);
}

TEST(Ports, BlockNeverWaitsForTheOnlyThreadThatCouldMakeRoom) {
  Harness harness;
  Qos patient = Qos::reliable(10);
  patient.max_blocking = std::chrono::hours(1);
  auto& talker = harness.make<Talker>("talker", {}, patient);
  auto& listener = harness.make<Listener>("listener", {}, Queue{2, WhenFull::block});
  harness.start();
  for (int i = 1; i <= 3; ++i) talker.say(i);
  harness.step();
  EXPECT_THAT(listener.heard, ElementsAre(1, 2));
  EXPECT_EQ(listener.input.stats().dropped, 1u);
}

TEST(Ports, TheDeploymentMayOverrideTopicQueueAndReliability) {
  Harness harness;
  ComponentConfig remapped;
  remapped.remap["numbers"] = "/counted";
  remapped.inputs["numbers"] = {
      .queue = 1, .when_full = WhenFull::drop_newest, .reliability = Qos::Reliability::best_effort};
  auto& listener = harness.make<Listener>("listener", remapped);
  ComponentConfig in_namespace;
  in_namespace.namespace_ = "/front";
  in_namespace.remap["/front/numbers"] = "/counted";
  auto& talker = harness.make<Talker>("talker", in_namespace);
  harness.start();
  EXPECT_EQ(listener.input.info().topic, "/counted");
  EXPECT_EQ(listener.input.info().qos.reliability, Qos::Reliability::best_effort);
  EXPECT_EQ(talker.output.info().topic, "/counted");
  EXPECT_EQ(talker.output.info().component, "/front/talker");
  talker.say(1);
  talker.say(2);
  harness.step();
  EXPECT_THAT(listener.heard, ElementsAre(1));
}

TEST(Ports, ALateJoinerGetsWhatALatchedOutputRetains) {
  Harness harness;
  auto& talker = harness.make<Talker>("talker", {}, Qos::latched(2));
  auto& late = harness.make<Listener>("late", {}, Queue{}, Qos::latched(10));
  auto& volatile_one = harness.make<Listener>("volatile", {}, Queue{}, Qos::reliable(10));
  ASSERT_TRUE(talker.core().configure() && talker.core().activate());
  for (int i = 1; i <= 3; ++i) talker.say(i);
  for (Listener* listener : {&late, &volatile_one}) {
    ASSERT_TRUE(listener->core().configure() && listener->core().activate());
  }
  harness.step();
  EXPECT_THAT(late.heard, ElementsAre(2, 3));
  EXPECT_THAT(volatile_one.heard, ElementsAre());
}

TEST(Ports, QosThatDoesNotMatchIsNotConnectedAndSaysWhy) {
  Harness harness;
  harness.sink->keep_records(10);
  auto& talker = harness.make<Talker>("talker", {}, Qos::sensor());
  auto& listener = harness.make<Listener>("listener", {}, Queue{}, Qos::reliable(10));
  harness.start();
  talker.say(1);
  harness.step();
  EXPECT_THAT(listener.heard, ElementsAre());
  LogRecord record;
  ASSERT_TRUE(harness.sink->take(record));
  EXPECT_THAT(record.text.data(), ::testing::HasSubstr("reliability"));
}

TEST(Ports, OnlyAnActiveComponentPublishesAndListens) {
  Harness harness;
  auto& talker = harness.make<Talker>("talker");
  auto& listener = harness.make<Listener>("listener");
  EXPECT_FALSE(talker.say(0));
  harness.start();
  ASSERT_TRUE(listener.core().deactivate());
  talker.say(1);
  ASSERT_TRUE(listener.core().activate());
  talker.say(2);
  harness.step();
  EXPECT_THAT(listener.heard, ElementsAre(2));
  EXPECT_EQ(talker.output.stats().refused, 1u);
}

TEST(Ports, BetweenProcessesMessagesAreEncodedAndBlobsViewTheSample) {
  FakeDomain domain;
  Harness sender(0, domain.join()), receiver(0, domain.join());
  auto& source = sender.make<CloudSource>("source");
  auto& local = sender.make<CloudSink>("local");
  auto& sink = receiver.make<CloudSink>("sink");
  sender.start();
  receiver.start();
  Loan<PointCloud2> loan = source.output.loan();
  loan->header.frame_id = "lidar";
  loan->data.resize(1000);
  loan->data.mutable_data()[999] = 42;
  source.output.publish(std::move(loan));
  sender.step();
  receiver.step();
  ASSERT_EQ(sink.clouds.size(), 1u);
  ASSERT_EQ(local.clouds.size(), 1u);  // once: not also through the middleware
  EXPECT_EQ(*sink.clouds[0], *local.clouds[0]);
  EXPECT_TRUE(sink.clouds[0]->data.is_view());
  EXPECT_EQ(source.output.stats().link.sent, 1u);
}

TEST(Ports, NothingIsEncodedWhenNobodyElseListens) {
  FakeDomain domain;
  Harness harness(0, domain.join());
  auto& talker = harness.make<Talker>("talker");
  auto& listener = harness.make<Listener>("listener");
  harness.start();
  talker.say(7);
  harness.step();
  EXPECT_THAT(listener.heard, ElementsAre(7));
  EXPECT_EQ(talker.output.stats().link.sent, 0u);
}

TEST(Ports, WhatCannotBeDecodedIsCountedWithItsReason) {
  FakeDomain domain;
  const auto remote = domain.join();
  Harness harness(0, domain.join());
  auto& sink = harness.make<CloudSink>("sink");
  harness.start();
  EndpointConfig config;
  config.topic = "/cloud";
  config.type = &type_info<PointCloud2>();
  config.qos = Qos::sensor();
  auto writer = remote->writer(config);
  ASSERT_TRUE(writer);
  const std::vector<std::byte> bad = {std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}, std::byte{9}};
  ASSERT_TRUE((*writer)->forward(bad));
  harness.step();
  const InputStats stats = sink.input.stats();
  EXPECT_EQ(stats.refused, 1u);
  EXPECT_EQ(stats.handled, 0u);
  EXPECT_EQ(stats.last_refusal, "truncated");
}

TEST(Ports, SamplesOfTheTimeBeforeActivationAreNotDelivered) {
  FakeDomain domain;
  Harness sender(0, domain.join()), receiver(0, domain.join());
  auto& talker = sender.make<Talker>("talker");
  auto& listener = receiver.make<Listener>("listener");
  sender.start();
  ASSERT_TRUE(listener.core().configure());
  talker.say(1);
  ASSERT_TRUE(listener.core().activate());
  talker.say(2);
  receiver.step();
  EXPECT_THAT(listener.heard, ElementsAre(2));
}

}  // namespace
}  // namespace adit
