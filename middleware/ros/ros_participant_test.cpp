#include "middleware/ros/ros_participant.hpp"

#include <gmock/gmock.h>

#include <map>

#include "middleware/ros/discovery_info.hpp"

namespace adit {
namespace {

using testing::ElementsAre;

constexpr TypeInfo points_type{"sensor_msgs/msg/PointCloud2", "sensor_msgs::msg::dds_::PointCloud2_", "RIHS01_ab", "",
                               64};

// A vendor that records what it was asked for and hands samples of ros_discovery_info back.
struct Vendor {
  std::vector<EndpointConfig> endpoints;
  std::vector<std::vector<std::byte>> announced;  // on ros_discovery_info
  std::vector<std::vector<std::byte>> incoming;
  Graph graph;
};

class FakeWriter final : public Writer {
 public:
  FakeWriter(Vendor& vendor, EndpointConfig config, Gid gid) : vendor_(vendor), config_(std::move(config)), gid_(gid) {}
  Result<void> publish(const Encoder&, Time) override { return {}; }
  Result<void> forward(Bytes cdr, Time) override {
    vendor_.announced.emplace_back(cdr.begin(), cdr.end());
    return {};
  }
  bool has_remote_readers() const override { return false; }
  Result<void> wait_for_acknowledgements(Duration) override { return {}; }
  LinkStats stats() const override { return {}; }
  const EndpointConfig& config() const override { return config_; }
  Gid gid() const override { return gid_; }

 private:
  Vendor& vendor_;
  EndpointConfig config_;
  Gid gid_;
};

class FakeReader final : public Reader {
 public:
  FakeReader(Vendor& vendor, EndpointConfig config, Gid gid) : vendor_(vendor), config_(std::move(config)), gid_(gid) {}
  std::size_t take(std::span<Sample> out) override {
    if (vendor_.incoming.empty() || out.empty()) return 0;
    taken_ = vendor_.incoming.front();
    vendor_.incoming.erase(vendor_.incoming.begin());
    out[0] = Sample(taken_, {}, {});
    return 1;
  }
  void on_data(Notify) override {}
  LinkStats stats() const override { return {}; }
  const EndpointConfig& config() const override { return config_; }
  Gid gid() const override { return gid_; }

 private:
  Vendor& vendor_;
  EndpointConfig config_;
  Gid gid_;
  std::vector<std::byte> taken_;
};

class FakeParticipant final : public Participant {
 public:
  FakeParticipant(Vendor& vendor, ParticipantConfig config) : vendor_(vendor), config_(std::move(config)) {}
  Result<std::unique_ptr<Writer>> writer(const EndpointConfig& config) override {
    vendor_.endpoints.push_back(config);
    return std::unique_ptr<Writer>(std::make_unique<FakeWriter>(vendor_, config, next()));
  }
  Result<std::unique_ptr<Reader>> reader(const EndpointConfig& config) override {
    vendor_.endpoints.push_back(config);
    return std::unique_ptr<Reader>(std::make_unique<FakeReader>(vendor_, config, next()));
  }
  Graph graph() const override { return vendor_.graph; }
  void on_event(EventHandler) override {}
  std::string explain() const override { return "fake\n"; }
  const ParticipantConfig& config() const override { return config_; }
  Gid gid() const override { return id(0xc1); }

  static Gid id(std::uint8_t last) {
    Gid gid;
    gid.bytes[0] = 1;
    gid.bytes[15] = last;
    return gid;
  }

 private:
  Gid next() { return id(++last_); }
  Vendor& vendor_;
  ParticipantConfig config_;
  std::uint8_t last_ = 0;
};

class RosParticipantTest : public testing::Test {
 protected:
  std::unique_ptr<Participant> make(const std::string& distro) {
    ParticipantConfig config;
    config.ros_distro = distro;
    Result<std::unique_ptr<Participant>> participant =
        make_ros_participant(std::make_unique<FakeParticipant>(vendor_, config));
    EXPECT_TRUE(participant);
    return *std::move(participant);
  }
  EndpointConfig points(const std::string& node) const {
    EndpointConfig config;
    config.topic = "/lidar/points";
    config.type = &points_type;
    config.node = node;
    return config;
  }
  DiscoveryInfo last_announced() const {
    DiscoveryInfo info;
    EXPECT_TRUE(decode_discovery(vendor_.announced.back(), info));
    return info;
  }

  Vendor vendor_;
};

TEST_F(RosParticipantTest, EndpointsGetRosNamesAndHashAndAreAnnouncedWhileTheyLive) {
  const std::unique_ptr<Participant> participant = make("jazzy");
  Result<std::unique_ptr<Writer>> writer = participant->writer(points("/perception/lidar"));
  ASSERT_TRUE(writer);
  EXPECT_EQ(vendor_.endpoints.back().topic, "rt/lidar/points");
  EXPECT_EQ(vendor_.endpoints.back().user_data, "typehash=RIHS01_ab;");
  EXPECT_EQ((*writer)->config().topic, "/lidar/points");
  const DiscoveryInfo info = last_announced();
  ASSERT_EQ(info.nodes.count("/perception/lidar"), 1u);
  EXPECT_THAT(info.nodes.at("/perception/lidar").writers, ElementsAre((*writer)->gid()));
  writer->reset();
  EXPECT_TRUE(last_announced().nodes.empty());
}

TEST_F(RosParticipantTest, HumbleAnnouncesLongGidsAndNoHash) {
  const std::unique_ptr<Participant> participant = make("humble");
  const Result<std::unique_ptr<Reader>> reader = participant->reader(points("/lidar"));
  ASSERT_TRUE(reader);
  EXPECT_EQ(vendor_.endpoints.back().user_data, "");
  EXPECT_EQ(vendor_.announced.back(), encode_discovery(last_announced(), GidForm::humble_24));
}

TEST_F(RosParticipantTest, WithoutRosGraphNothingIsAnnounced) {
  const std::unique_ptr<Participant> participant = make("none");
  const Result<std::unique_ptr<Writer>> writer = participant->writer(points("/lidar"));
  ASSERT_TRUE(writer);
  EXPECT_EQ(vendor_.endpoints.size(), 1u);
  EXPECT_TRUE(vendor_.announced.empty());
}

TEST_F(RosParticipantTest, InvalidNamesAreRefused) {
  const std::unique_ptr<Participant> participant = make("jazzy");
  EndpointConfig config = points("/lidar");
  config.topic = "/2bad";
  EXPECT_FALSE(participant->writer(config));
  EXPECT_FALSE(participant->reader(points("no_slash")));
}

TEST_F(RosParticipantTest, GraphNamesNodesOfOthersUntilTheirParticipantLeaves) {
  const std::unique_ptr<Participant> participant = make("jazzy");
  Gid other = FakeParticipant::id(0xc1);
  other.bytes[5] = 9;
  Gid endpoint = other;
  endpoint.bytes[15] = 3;
  vendor_.graph.participants = {{other, "", "/", "Fast DDS", false}};
  EndpointInfo info;
  info.gid = endpoint;
  info.dds_topic = "rt/chatter";
  info.dds_type = "std_msgs::msg::dds_::String_";
  vendor_.graph.endpoints = {info};
  vendor_.incoming = {encode_discovery({other, {{"/talker", {{}, {endpoint}}}}}, GidForm::humble_24)};
  Graph graph = participant->graph();
  EXPECT_THAT(graph.nodes, ElementsAre("/talker"));
  ASSERT_EQ(graph.endpoints.size(), 1u);
  EXPECT_EQ(graph.endpoints[0].topic, "/chatter");
  EXPECT_EQ(graph.endpoints[0].type, "std_msgs/msg/String");
  EXPECT_EQ(graph.endpoints[0].node, "/talker");
  vendor_.graph = {};
  EXPECT_TRUE(participant->graph().nodes.empty());
}

TEST(RosDistro, OnlyKnownOnesAreValid) {
  for (const char* known : {"humble", "iron", "jazzy", "none"}) EXPECT_TRUE(validate_ros_distro(known));
  EXPECT_FALSE(validate_ros_distro("foxy"));
}

}  // namespace
}  // namespace adit
