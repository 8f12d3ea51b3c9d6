#include "middleware/ros/discovery_info.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace adit {
namespace {

Gid gid(std::uint8_t last) {
  Gid gid;
  for (std::size_t i = 0; i < gid.bytes.size(); ++i) gid.bytes[i] = static_cast<std::uint8_t>(i + 1);
  gid.bytes.back() = last;
  return gid;
}

TEST(DiscoveryInfo, BothFormsSurviveTheRoundTripAndAreToldApart) {
  DiscoveryInfo info;
  info.participant = gid(0xc1);
  info.nodes["/perception/lidar"] = {{gid(4), gid(8)}, {gid(3)}};
  info.nodes["/talker"] = {};
  for (const GidForm form : {GidForm::humble_24, GidForm::iron_16}) {
    for (const bool empty : {false, true}) {
      if (empty) info.nodes.clear();
      DiscoveryInfo read;
      ASSERT_TRUE(decode_discovery(encode_discovery(info, form), read));
      EXPECT_EQ(read.participant, info.participant);
      ASSERT_EQ(read.nodes.size(), info.nodes.size());
      if (!empty) {
        EXPECT_EQ(read.nodes["/perception/lidar"].readers, info.nodes["/perception/lidar"].readers);
        EXPECT_EQ(read.nodes["/perception/lidar"].writers, info.nodes["/perception/lidar"].writers);
      }
    }
    info.nodes["/perception/lidar"] = {{gid(4), gid(8)}, {gid(3)}};
  }
}

TEST(DiscoveryInfo, MalformedSamplesAreRefused) {
  DiscoveryInfo info;
  std::vector<std::byte> bytes = encode_discovery({gid(0xc1), {{"/talker", {{gid(4)}, {}}}}}, GidForm::iron_16);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(decode_discovery(Bytes(bytes).first(size), info)) << size;
  }
}

TEST(DiscoveryInfo, ReadsWhatRos2Sent) {
  const char* const place = std::getenv("ADIT_SHARED");
  const std::filesystem::path golden = std::filesystem::path(place ? place : ADIT_SOURCE_DIR "/../shared") / "golden";
  if (!std::filesystem::exists(golden)) GTEST_SKIP() << "skipped: no shared data";
  for (const char* name : {"humble_cyclone", "humble_fastrtps", "jazzy_cyclone"}) {
    std::ifstream file(golden / (std::string("ros_discovery_info.") + name + ".cdr"), std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(file)), {});
    DiscoveryInfo info;
    ASSERT_TRUE(decode_discovery(std::as_bytes(std::span(text)), info)) << name;
    EXPECT_EQ(info.participant.bytes[14], 0x01) << name;
    EXPECT_EQ(info.participant.bytes[15], 0xc1) << name;
    ASSERT_FALSE(info.nodes.empty()) << name;
    EXPECT_EQ(info.nodes.begin()->first.front(), '/');
    EXPECT_TRUE(info.nodes.begin()->second.writers.front().same_participant(info.participant)) << name;
  }
}

}  // namespace
}  // namespace adit
