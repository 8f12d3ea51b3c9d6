#include "bringup/commands/topic_monitor.hpp"

#include <gtest/gtest.h>

#include <array>

namespace adit {
namespace {

std::vector<std::byte> bytes(std::initializer_list<int> values) {
  std::vector<std::byte> out;
  for (const int value : values) out.push_back(static_cast<std::byte>(value));
  return out;
}

TEST(LeadingStamp, ReadsBothEndiannesses) {
  const auto little = bytes({0, 1, 0, 0, 2, 0, 0, 0, 0, 202, 154, 59, 0});
  EXPECT_FALSE(leading_stamp(little));  // 10^9 ns is no nanosecond field
  EXPECT_EQ(leading_stamp(bytes({0, 1, 0, 0, 2, 0, 0, 0, 5, 0, 0, 0})), Time(std::chrono::nanoseconds(2'000'000'005)));
  EXPECT_EQ(leading_stamp(bytes({0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 5})), Time(std::chrono::nanoseconds(2'000'000'005)));
  EXPECT_FALSE(leading_stamp(bytes({0, 1, 0, 0, 2})));
}

TEST(LeadingStamp, OnlyTypesThatBeginWithOneHaveIt) {
  TypeInfo type{};
  type.schema = "# comment\nuint8 A=1\nstd_msgs/Header header\nstring data\n";
  EXPECT_TRUE(begins_with_stamp(type));
  type.schema = "string data\nstd_msgs/Header header\n";
  EXPECT_FALSE(begins_with_stamp(type));
  type.schema = "";
  EXPECT_FALSE(begins_with_stamp(type));
}

TEST(MatchingQos, AsksForWhatAllWritersOffer) {
  EndpointInfo reliable, latched, sensor;
  reliable.qos = Qos::reliable();
  latched.qos = Qos::latched();
  sensor.qos = Qos::sensor();
  EXPECT_EQ(matching_qos({latched}).durability, Qos::Durability::transient_local);
  EXPECT_EQ(matching_qos({latched, reliable}).durability, Qos::Durability::volatile_);
  EXPECT_EQ(matching_qos({latched, reliable}).reliability, Qos::Reliability::reliable);
  for (const auto& writers : {std::vector{latched, sensor}, std::vector{sensor}}) {
    for (const EndpointInfo& writer : writers) EXPECT_TRUE(check(writer.qos, matching_qos(writers)).empty());
  }
}

}  // namespace
}  // namespace adit
