// Recorder and player against live writers and readers, on each vendor.
#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "bringup/recording/player.hpp"
#include "bringup/recording/recorder.hpp"
#include "components/dataset/bag_qos.hpp"
#include "components/dataset/bag_reader.hpp"
#include "idl/codec.hpp"
#include "rosgraph_msgs/msg/clock.hpp"
#include "std_msgs/msg/string.hpp"

namespace adit {
namespace {

namespace fs = std::filesystem;
using std_msgs::msg::String;
using testing::HasSubstr;
using namespace std::chrono_literals;

// A type no program is built with.
const TypeInfo foreign_type{"foreign_msgs/msg/Gas", "foreign_msgs::msg::dds_::Gas_", "RIHS01_ab", "", 64};

struct Received {
  std::vector<std::vector<std::byte>> samples;
  std::vector<std::chrono::steady_clock::time_point> at;
};

// A serialized String; filled up to whole words, because a vendor may pad a sample to them (Sample's documentation).
std::vector<std::byte> text(std::string content) {
  content.resize(content.size() + 3 - content.size() % 4, '.');
  String message;
  message.data = std::move(content);
  std::vector<std::byte> bytes(encoded_size(message));
  encode(message, bytes);
  return bytes;
}

class Recording : public ::testing::TestWithParam<std::string_view> {
 protected:
  void SetUp() override {
    static std::uint32_t used = 0;
    config_.vendor = GetParam();
    config_.domain = 101 + (static_cast<std::uint32_t>(::getpid()) * 7 + used++) % 100;  // see runtime's loopback tests
    config_.name = "recording_test";
    folder_ = fs::temp_directory_path() / ("adit_recording_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
    auto participant = open(config_);
    ASSERT_TRUE(participant) << participant.error().message;
    participant_ = *std::move(participant);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string path(const char* name) const { return (folder_ / name).string(); }
  EndpointConfig endpoint(const std::string& topic, const TypeInfo& type, const Qos& qos) const {
    EndpointConfig config;
    config.topic = topic;
    config.type = &type;
    config.qos = qos;
    config.node = "/test";
    return config;
  }
  std::unique_ptr<Writer> writer(const std::string& topic, const TypeInfo& type, const Qos& qos) {
    auto made = participant_->writer(endpoint(topic, type, qos));
    EXPECT_TRUE(made) << made.error().message;
    return made ? *std::move(made) : nullptr;
  }
  std::unique_ptr<Reader> reader(const std::string& topic, const TypeInfo& type, const Qos& qos) {
    auto made = participant_->reader(endpoint(topic, type, qos));
    EXPECT_TRUE(made) << made.error().message;
    return made ? *std::move(made) : nullptr;
  }
  std::unique_ptr<Recorder> recorder(std::vector<std::string> topics = {}) {
    auto made = Recorder::open({config_, path("bag"), std::move(topics)});
    EXPECT_TRUE(made) << made.error().message;
    return made ? *std::move(made) : nullptr;
  }
  // Steps until `holds`, at most ten seconds.
  static bool step_until(Recorder& recorder, const std::function<bool()>& holds) {
    const auto end = std::chrono::steady_clock::now() + 10s;
    while (!holds() && std::chrono::steady_clock::now() < end) {
      const Result<void> stepped = recorder.step(20ms);
      EXPECT_TRUE(stepped) << stepped.error().message;
    }
    return holds();
  }
  static Recorder::TopicState state(const Recorder& recorder, const std::string& topic) {
    for (Recorder::TopicState& state : recorder.topics()) {
      if (state.name == topic) return state;
    }
    return {};
  }
  static bool matched(const Writer& writer) { return writer.stats().matched > 0; }
  static void take_all(Reader& reader, Received& out) {
    Sample sample;
    while (reader.take({&sample, 1}) == 1) {
      out.samples.emplace_back(sample.bytes().begin(), sample.bytes().end());
      out.at.push_back(std::chrono::steady_clock::now());
    }
  }

  ParticipantConfig config_;
  fs::path folder_;
  std::unique_ptr<Participant> participant_;
};

TEST_P(Recording, StoresEveryTopicByteForByte) {
  const auto words = writer("/words", type_info<String>(), Qos::reliable(100));
  const auto rig = writer("/rig", type_info<String>(), Qos::latched());
  ASSERT_TRUE(rig->forward(text("before the recording")));
  const auto recording = recorder();
  ASSERT_TRUE(step_until(*recording, [&] { return matched(*words) && state(*recording, "/rig").samples == 1; }));
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(words->forward(text("word " + std::to_string(i))));
  // Appears later, with a type that is not built in.
  const auto gas = writer("/gas", foreign_type, Qos::sensor());
  ASSERT_TRUE(step_until(*recording, [&] { return matched(*gas) && state(*recording, "/words").samples == 50; }));
  ASSERT_TRUE(gas->forward(text("opaque")));
  ASSERT_TRUE(step_until(*recording, [&] { return state(*recording, "/gas").samples == 1; }));
  ASSERT_TRUE(recording->close());
  for (const Recorder::TopicState& topic : recording->topics()) {
    EXPECT_EQ(topic.lost, 0U) << topic.name;
    EXPECT_EQ(topic.problem, "") << topic.name;
  }

  auto bag = dataset::BagReader::open(path("bag"));
  ASSERT_TRUE(bag) << bag.error().message;
  std::map<std::string, std::vector<std::vector<std::byte>>> stored;
  dataset::BagSample sample;
  while (*(*bag)->next(sample)) {
    stored[(*bag)->info().topics[sample.topic].name].emplace_back(sample.cdr.begin(), sample.cdr.end());
  }
  ASSERT_EQ(stored["/words"].size(), 50U);
  for (int i = 0; i < 50; ++i)
    EXPECT_EQ(stored["/words"][static_cast<std::size_t>(i)], text("word " + std::to_string(i)));
  EXPECT_THAT(stored["/rig"], testing::ElementsAre(text("before the recording")));
  EXPECT_THAT(stored["/gas"], testing::ElementsAre(text("opaque")));
  for (const dataset::BagTopic& topic : (*bag)->info().topics) {
    const dataset::BagQos offer = *dataset::bag_qos_offer(topic.qos);
    EXPECT_EQ(offer.transient_local, topic.name == "/rig");
    if (topic.name == "/gas") {
      EXPECT_FALSE(offer.reliable);
      EXPECT_EQ(topic.type, foreign_type.ros_name);
    }
    EXPECT_EQ(topic.type_hash,
              topic.type == foreign_type.ros_name ? foreign_type.type_hash : type_info<String>().type_hash);
  }
}

TEST_P(Recording, AWriterThatOffersLessIsHeardToo) {
  const auto reliable = writer("/words", type_info<String>(), Qos::reliable());
  const auto recording = recorder({"/words"});
  ASSERT_TRUE(step_until(*recording, [&] { return matched(*reliable); }));
  const auto best_effort = writer("/words", type_info<String>(), Qos::sensor());
  ASSERT_TRUE(step_until(*recording, [&] { return matched(*best_effort) && matched(*reliable); }));
  ASSERT_TRUE(best_effort->forward(text("b")));
  ASSERT_TRUE(reliable->forward(text("r")));
  EXPECT_TRUE(step_until(*recording, [&] { return state(*recording, "/words").samples == 2; }));
  EXPECT_EQ(state(*recording, "/words").lost, 0U);
}

TEST_P(Recording, SaysWhatItDidNotRecord) {
  const auto other = writer("/other", type_info<String>(), Qos::reliable());
  const auto recording = recorder({"/never", "/wanted"});
  const auto wanted = writer("/wanted", type_info<String>(), Qos::reliable());
  ASSERT_TRUE(step_until(*recording, [&] { return matched(*wanted); }));
  EXPECT_FALSE(matched(*other));
  EXPECT_THAT(state(*recording, "/never").problem, HasSubstr("nobody"));
  EXPECT_EQ(state(*recording, "/wanted").problem, "");
  EXPECT_EQ(state(*recording, "/other").name, "");
}

// A bag of ten messages 50 ms apart and a latched one before them.
void write_bag(const std::string& folder) {
  auto bag = dataset::BagWriter::create(folder);
  ASSERT_TRUE(bag) << bag.error().message;
  const TypeInfo& type = type_info<String>();
  const std::string name(type.ros_name);
  const auto words = (*bag)->add_topic({"/words", name, dataset::bag_qos_text({{true, false, 100}}), "", ""});
  const auto rig = (*bag)->add_topic({"/rig", name, dataset::bag_qos_text({{true, true, 1}}), "", ""});
  ASSERT_TRUE((*bag)->write({*rig, 5'000'000'000, text("rig")}));
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE((*bag)->write({*words, 5'000'000'000 + i * 50'000'000, text("word " + std::to_string(i))}));
  }
  ASSERT_TRUE((*bag)->close());
}

TEST_P(Recording, PlaysAtTheRecordedPaceWithTheRecordedQos) {
  write_bag(path("bag"));
  const auto ear = reader("/heard", type_info<String>(), Qos::reliable(100));
  const auto rig_ear = reader("/rig", type_info<String>(), Qos::latched());
  const auto clock_ear = reader("/clock", type_info<rosgraph_msgs::msg::Clock>(), Qos::reliable(100));
  const auto clock_sensor = reader("/clock", type_info<rosgraph_msgs::msg::Clock>(), {Qos::sensor()});
  PlayerConfig config;
  config.participant = config_;
  config.bag = path("bag");
  config.remap = {{"/words", "/heard"}};
  config.rate = 2.0;
  config.start_s = 0.1;  // the third word; the rig is older
  config.clock_hz = 100.0;
  auto player = Player::open(config);
  ASSERT_TRUE(player) << player.error().message;
  EXPECT_EQ((*player)->length(), 350ms);
  (*player)->wait_for_readers(5s);
  const auto end = std::chrono::steady_clock::now() + 10s;
  while ((ear->stats().matched == 0 || rig_ear->stats().matched == 0 || clock_sensor->stats().matched == 0) &&
         std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(10ms);
  }
  Received words, rig, clock;
  std::thread playing([&] {
    const Result<void> played = (*player)->run([](Duration) { return true; });
    EXPECT_TRUE(played) << played.error().message;
  });
  while (words.samples.size() < 8 && std::chrono::steady_clock::now() < end) {
    take_all(*ear, words);
    take_all(*rig_ear, rig);
    take_all(*clock_sensor, clock);
    std::this_thread::sleep_for(1ms);
  }
  playing.join();
  take_all(*rig_ear, rig);
  ASSERT_EQ(words.samples.size(), 8U);
  for (int i = 0; i < 8; ++i)
    EXPECT_EQ(words.samples[static_cast<std::size_t>(i)], text("word " + std::to_string(i + 2)));
  EXPECT_THAT(rig.samples, testing::ElementsAre(text("rig")));
  // 350 ms at twice the pace; never early, and how late is the machine's business.
  EXPECT_GE(words.at.back() - words.at.front(), 140ms);
  EXPECT_GE(clock.samples.size(), 10U);
  EXPECT_EQ(clock_ear->stats().received, 0U);  // /clock is best effort, as ROS 2 has it
  rosgraph_msgs::msg::Clock time;
  ASSERT_EQ(decode(clock.samples.front(), time), DecodeStatus::ok);
  EXPECT_EQ(time.clock.sec, 5);
  EXPECT_GE(time.clock.nanosec, 100'000'000U);
  EXPECT_EQ((*player)->counts().sent, 9U);
  EXPECT_EQ((*player)->counts().refused, 0U);
}

TEST_P(Recording, LoopsUntilToldToStop) {
  write_bag(path("bag"));
  PlayerConfig config;
  config.participant = config_;
  config.bag = path("bag");
  config.topics = {"/words"};
  config.rate = 50.0;
  config.loop = true;
  auto player = Player::open(config);
  ASSERT_TRUE(player) << player.error().message;
  ASSERT_TRUE((*player)->run([&](Duration) { return (*player)->counts().sent < 35; }));
  EXPECT_GE((*player)->counts().sent, 35U);
}

TEST_P(Recording, RefusesWhatCannotBePlayed) {
  write_bag(path("bag"));
  const auto message = [&](const std::function<void(PlayerConfig&)>& change) {
    PlayerConfig config;
    config.participant = config_;
    config.bag = path("bag");
    change(config);
    const auto player = Player::open(config);
    return player ? std::string() : player.error().message;
  };
  EXPECT_EQ(message([](PlayerConfig&) {}), "");
  EXPECT_THAT(message([](PlayerConfig& c) { c.bag = "/nowhere"; }), HasSubstr("no such file"));
  EXPECT_THAT(message([](PlayerConfig& c) { c.topics = {"/absent"}; }), HasSubstr("no topic /absent"));
  EXPECT_THAT(message([](PlayerConfig& c) {
                c.remap = {{"/words", "/rig"}};
              }),
              HasSubstr("would both be sent as /rig"));
  EXPECT_THAT(message([](PlayerConfig& c) { c.start_s = 60.0; }), HasSubstr("nothing to play"));
  EXPECT_THAT(message([](PlayerConfig& c) { c.rate = 0.0; }), HasSubstr("rate"));
}

INSTANTIATE_TEST_SUITE_P(Vendors, Recording, testing::ValuesIn(built_in_vendors().begin(), built_in_vendors().end()),
                         [](const auto& tested) { return std::string(tested.param); });

}  // namespace
}  // namespace adit
