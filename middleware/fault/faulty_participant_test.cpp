#include "middleware/fault/faulty_participant.hpp"

#include <gmock/gmock.h>

#include <condition_variable>
#include <cstring>

#include "middleware/fault/fake_participant.hpp"

namespace adit {
namespace {

using namespace std::chrono_literals;

constexpr TypeInfo type{"std_msgs/msg/String", "std_msgs::msg::dds_::String_", "", "", 64};

EndpointConfig endpoint(const std::string& topic) {
  EndpointConfig config;
  config.topic = topic;
  config.type = &type;
  return config;
}

std::vector<std::byte> message() {
  std::vector<std::byte> bytes(32, std::byte{7});
  const std::byte header[4] = {std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}};
  std::memcpy(bytes.data(), header, 4);
  return bytes;
}

std::size_t take_all(Reader& reader) {
  Sample out[8];
  std::size_t count = 0;
  while (const std::size_t taken = reader.take(out)) count += taken;
  return count;
}

struct World {
  explicit World(FaultPlan plan)
      : participant(wrap_with_faults(std::make_unique<fault::FakeParticipant>(), std::move(plan))) {}
  std::unique_ptr<Writer> writer(const std::string& topic) { return *participant->writer(endpoint(topic)); }
  std::unique_ptr<Reader> reader(const std::string& topic) { return *participant->reader(endpoint(topic)); }
  std::unique_ptr<FaultyParticipant> participant;
};

TEST(FaultyParticipant, RulesActOnTheirTopicsAndSideOnly) {
  World world({.seed = 1, .rules = {{.topic = "/lidar/*", .side = FaultSide::reading, .drop = 1.0}}});
  const auto cloud_writer = world.writer("/lidar/points");
  const auto cloud_reader = world.reader("/lidar/points");
  const auto imu_writer = world.writer("/imu");
  const auto imu_reader = world.reader("/imu");
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(cloud_writer->forward(message()));
    ASSERT_TRUE(imu_writer->forward(message()));
  }
  EXPECT_EQ(take_all(*cloud_reader), 0u);
  EXPECT_EQ(take_all(*imu_reader), 5u);
  EXPECT_EQ(world.participant->counters("*", FaultSide::reading).dropped, 5u);
  EXPECT_EQ(world.participant->counters("*", FaultSide::writing), FaultCounters{});
  EXPECT_EQ(cloud_writer->stats().sent, 5u);
}

TEST(FaultyParticipant, WritingSideKeepsSamplesFromBeingSent) {
  World world({.seed = 1, .rules = {{.topic = "/a", .side = FaultSide::writing, .drop_every = 2}}});
  const auto writer = world.writer("/a");
  const auto reader = world.reader("/a");
  for (int i = 0; i < 6; ++i) ASSERT_TRUE(writer->forward(message(), Time(1s)));
  Sample out[8];
  ASSERT_EQ(reader->take(out), 3u);
  EXPECT_EQ(out[0].info().source_time, Time(1s));
  EXPECT_EQ(out[0].bytes().size(), 32u);
  EXPECT_EQ(writer->stats().sent, 3u);
  EXPECT_EQ(world.participant->counters("/a", FaultSide::writing).dropped, 3u);
}

TEST(FaultyParticipant, ReadersOfOneTopicMeetDifferentFaultsButTheSameInTheNextRun) {
  const auto run = [] {
    World world({.seed = 5, .rules = {{.topic = "*", .drop = 0.5}}});
    const auto writer = world.writer("/a");
    const auto first = world.reader("/a"), second = world.reader("/a");
    std::vector<std::uint64_t> passed[2];
    for (int i = 0; i < 64; ++i) (void)writer->forward(message());
    Sample out[64];
    for (std::size_t n = first->take(out), i = 0; i < n; ++i) passed[0].push_back(out[i].info().sequence);
    for (std::size_t n = second->take(out), i = 0; i < n; ++i) passed[1].push_back(out[i].info().sequence);
    return std::pair(passed[0], passed[1]);
  };
  const auto once = run();
  EXPECT_NE(once.first, once.second);
  EXPECT_EQ(run(), once);
}

TEST(FaultyParticipant, DelayedSamplesWakeTheReader) {
  World world({.seed = 1, .rules = {{.topic = "/a", .delay = 20ms}}});
  const auto writer = world.writer("/a");
  const auto reader = world.reader("/a");
  std::mutex mutex;
  std::condition_variable wake;
  int calls = 0;
  reader->on_data([&] {
    const std::lock_guard lock(mutex);
    ++calls;
    wake.notify_all();
  });
  ASSERT_TRUE(writer->forward(message()));
  std::size_t got = 0;
  int seen = 0;
  while (got == 0) {
    std::unique_lock lock(mutex);
    ASSERT_TRUE(wake.wait_for(lock, 10s, [&] { return calls > seen; }));
    seen = calls;
    lock.unlock();
    got += take_all(*reader);
  }
  EXPECT_EQ(got, 1u);
  reader->on_data(nullptr);
}

TEST(FaultyParticipant, MuteAppliesToPresentAndFutureEndpoints) {
  World world({.seed = 1, .rules = {{.topic = "*"}}});
  const auto writer = world.writer("/a");
  const auto first = world.reader("/a");
  world.participant->mute("/a", FaultSide::reading);
  const auto second = world.reader("/a");
  ASSERT_TRUE(writer->forward(message()));
  EXPECT_EQ(take_all(*first) + take_all(*second), 0u);
  world.participant->unmute("/a", FaultSide::reading);
  ASSERT_TRUE(writer->forward(message()));
  EXPECT_EQ(take_all(*first), 1u);
  EXPECT_EQ(take_all(*second), 1u);
  EXPECT_EQ(world.participant->counters("/a", FaultSide::reading).muted, 2u);
}

TEST(FaultyParticipant, ExplainSaysThatFaultsAreInjected) {
  World world({.seed = 9, .rules = {{.topic = "/lidar/*"}}});
  EXPECT_THAT(world.participant->explain(), testing::HasSubstr("seed 9: reading /lidar/*"));
}

}  // namespace
}  // namespace adit
