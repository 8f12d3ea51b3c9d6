#include "idl/codec.hpp"

#include <gmock/gmock.h>

#include <cstring>

#include "adit_msgs/msg/fusion_status.hpp"
#include "diagnostic_msgs/msg/diagnostic_array.hpp"
#include "idl/json_writer.hpp"
#include "idl/reference_encoder_test.hpp"
#include "idl/testing/allocation_counter.hpp"
#include "idl/type_registry.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "nav_msgs/msg/path.hpp"
#include "rcl_interfaces/msg/log.hpp"
#include "rcl_interfaces/msg/parameter_descriptor.hpp"
#include "rcl_interfaces/msg/parameter_value.hpp"
#include "rcl_interfaces/srv/list_parameters.hpp"
#include "rmw_dds_common/msg/participant_entities_info.hpp"
#include "rmw_dds_common/msg_humble/participant_entities_info.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "std_msgs/msg/empty.hpp"
#include "std_msgs/msg/string.hpp"

namespace adit {
namespace {

using sensor_msgs::msg::PointCloud2;
using sensor_msgs::msg::PointField;

template <class T>
std::vector<std::byte> encoded(const T& message) {
  std::vector<std::byte> bytes(encoded_size(message), std::byte{0xee});
  EXPECT_EQ(encode(message, bytes), bytes.size());
  return bytes;
}

PointCloud2 sample_cloud() {
  PointCloud2 cloud;
  cloud.header.stamp.sec = -3;
  cloud.header.stamp.nanosec = 999999999;
  cloud.header.frame_id = "lidar";
  cloud.height = 1;
  cloud.width = 3;
  for (const char* name : {"x", "y", "intensity"}) {
    PointField field;
    field.name = name;
    field.datatype = PointField::FLOAT32;
    field.count = 1;
    cloud.fields.push_back(field);
  }
  cloud.point_step = 2;
  cloud.row_step = 6;
  cloud.data = Blob{1, 2, 3, 4, 5, 6};
  cloud.is_dense = true;
  return cloud;
}

rcl_interfaces::msg::ParameterValue sample_value() {
  rcl_interfaces::msg::ParameterValue value;
  value.type = 9;
  value.bool_value = true;
  value.integer_value = -7;
  value.double_value = 2.5;
  value.string_value = "text";
  value.byte_array_value = Blob{9, 8, 7};
  value.bool_array_value = {true, false, true};
  value.integer_array_value = {1, -1};
  value.double_array_value = {0.5};
  value.string_array_value = {"", "b", "long enough for the heap, surely"};
  return value;
}

nav_msgs::msg::Odometry sample_odometry() {
  nav_msgs::msg::Odometry odometry;
  odometry.header.frame_id = "odom";
  odometry.child_frame_id = "base_link";
  odometry.pose.pose.position.x = 1.0 / 3.0;
  odometry.twist.covariance[35] = 1e300;
  return odometry;
}

template <class T>
void expect_round_trip(const T& message) {
  EXPECT_EQ(encoded(message), ReferenceEncoder(false)(message));
  for (const bool bigendian : {false, true}) {
    // Padding may hold anything, and more padding may follow.
    std::vector<std::byte> bytes = ReferenceEncoder(bigendian, 0xa5)(message);
    for (int trailing = 0; trailing < 9; ++trailing, bytes.push_back(std::byte{0x5a})) {
      T decoded;
      ASSERT_EQ(decode(bytes, decoded), DecodeStatus::ok);
      EXPECT_EQ(decoded, message);
    }
  }
}

TEST(Codec, RoundTripInBothEndiannesses) {
  expect_round_trip(sample_cloud());
  expect_round_trip(sample_odometry());
  expect_round_trip(sample_value());
  expect_round_trip(std_msgs::msg::Empty{});
  expect_round_trip(adit_msgs::msg::FusionStatus{});
  nav_msgs::msg::Path path;
  path.poses.resize(3);
  path.poses[1].header.frame_id = "abc";
  expect_round_trip(path);
}

TEST(Codec, PaddingIsZero) {
  std_msgs::msg::String text;
  text.data = "ab";
  diagnostic_msgs::msg::DiagnosticStatus status;
  status.level = diagnostic_msgs::msg::DiagnosticStatus::WARN;
  const auto bytes = encoded(status);
  for (const std::size_t at : {5, 6, 7}) EXPECT_EQ(bytes[at], std::byte{0});
}

TEST(Codec, EveryTruncationIsRejectedWithoutTouchingMore) {
  const auto check = [](const auto& message) {
    const auto bytes = encoded(message);
    std::remove_cvref_t<decltype(message)> out;
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      const std::vector<std::byte> cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
      const DecodeStatus status = decode(cut, out);
      EXPECT_TRUE(status == DecodeStatus::truncated || status == DecodeStatus::length_exceeds_payload) << size;
    }
    EXPECT_EQ(decode(bytes, out), DecodeStatus::ok);
    EXPECT_EQ(out, message);
  };
  check(sample_cloud());
  check(sample_value());
  check(sample_odometry());
}

TEST(Codec, ReasonsOfRejection) {
  std_msgs::msg::String out;
  const auto status = [&](std::initializer_list<int> bytes) {
    std::vector<std::byte> payload;
    for (const int byte : bytes) payload.push_back(std::byte(byte));
    return decode(payload, out);
  };
  EXPECT_EQ(status({}), DecodeStatus::truncated);
  EXPECT_EQ(status({0, 1, 0}), DecodeStatus::truncated);
  EXPECT_EQ(status({0, 1, 0, 0}), DecodeStatus::truncated);
  EXPECT_EQ(status({0, 2, 0, 0, 1, 0, 0, 0, 0}), DecodeStatus::bad_encapsulation);  // parameter list
  EXPECT_EQ(status({0, 7, 0, 0, 1, 0, 0, 0, 0}), DecodeStatus::bad_encapsulation);  // XCDR2
  EXPECT_EQ(status({1, 1, 0, 0, 1, 0, 0, 0, 0}), DecodeStatus::bad_encapsulation);
  EXPECT_EQ(status({0, 1, 0, 0, 2, 0, 0, 0, 'a', 'b'}), DecodeStatus::unterminated_string);
  EXPECT_EQ(status({0, 1, 0, 0, 255, 255, 255, 255, 0}), DecodeStatus::length_exceeds_payload);
  EXPECT_EQ(status({0, 1, 0, 0, 0, 0, 0, 0}), DecodeStatus::ok);  // no NUL at all: some write empty strings so
  EXPECT_EQ(out.data, "");
  EXPECT_EQ(status({0, 1, 9, 9, 2, 0, 0, 0, 'a', 0}), DecodeStatus::ok);  // options are ignored
  EXPECT_EQ(out.data, "a");

  auto bytes = encoded(sample_cloud());
  bytes.back() = std::byte{2};
  PointCloud2 cloud;
  EXPECT_EQ(decode(bytes, cloud), DecodeStatus::bad_boolean);
  EXPECT_EQ(to_string(DecodeStatus::bad_boolean), "bad boolean");
}

TEST(Codec, BoundsAreKept) {
  rcl_interfaces::msg::ParameterDescriptor descriptor;
  descriptor.integer_range.resize(1);
  const auto good = encoded(descriptor);
  expect_round_trip(descriptor);
  descriptor.integer_range.resize(2);
  std::vector<std::byte> bytes(encoded_size(descriptor));
  EXPECT_EQ(encode(descriptor, bytes), 0u);
  const auto too_long = ReferenceEncoder(false)(descriptor);
  EXPECT_EQ(decode(too_long, descriptor), DecodeStatus::bound_exceeded);
  EXPECT_EQ(decode(good, descriptor), DecodeStatus::ok);

  rmw_dds_common::msg::NodeEntitiesInfo node;
  node.node_name = std::string(256, 'n');
  expect_round_trip(node);
  node.node_name += 'n';
  EXPECT_EQ(decode(ReferenceEncoder(false)(node), node), DecodeStatus::bound_exceeded);
}

TEST(Codec, AnnouncedLengthsDoNotAllocate) {
  auto bytes = encoded(nav_msgs::msg::Path{});
  for (const std::uint32_t count : {10u, 0x00ffffffu, 0xffffffffu}) {
    std::memcpy(bytes.data() + bytes.size() - 4, &count, 4);
    nav_msgs::msg::Path path;
    const std::uint64_t before = test::allocations_of_this_thread();
    EXPECT_EQ(decode(bytes, path), DecodeStatus::length_exceeds_payload);
    EXPECT_EQ(test::allocations_of_this_thread(), before);
  }
}

TEST(Codec, SteadyStateDoesNotAllocate) {
  const auto check = [](const auto& message) {
    std::vector<std::byte> bytes = encoded(message);
    std::remove_cvref_t<decltype(message)> out;
    ASSERT_EQ(decode(bytes, out), DecodeStatus::ok);
    const std::uint64_t before = test::allocations_of_this_thread();
    for (int i = 0; i < 3; ++i) {
      ASSERT_EQ(decode(bytes, out), DecodeStatus::ok);
      MessageEncoder encoder(out);
      ASSERT_EQ(encoder.write(bytes), encoder.size());
    }
    EXPECT_EQ(test::allocations_of_this_thread(), before);
    EXPECT_EQ(out, message);
  };
  check(sample_cloud());
  check(sample_odometry());
  check(sample_value());
}

TEST(Codec, BlobsViewThePayloadWhileItIsKept) {
  static int references = 0;
  static constexpr KeepAliveOperations operations = {[](void*) noexcept { ++references; },
                                                     [](void*) noexcept { --references; }};
  references = 1;
  const auto bytes = encoded(sample_cloud());
  {
    PointCloud2 cloud;
    {
      const KeepAlive keep_alive(&operations, &references);
      ASSERT_EQ(decode(bytes, cloud, keep_alive), DecodeStatus::ok);
    }
    EXPECT_TRUE(cloud.data.is_view());
    EXPECT_GE(reinterpret_cast<const std::byte*>(cloud.data.data()), bytes.data());
    EXPECT_LT(reinterpret_cast<const std::byte*>(cloud.data.data()), bytes.data() + bytes.size());
    EXPECT_EQ(cloud, sample_cloud());
    EXPECT_EQ(references, 1);
  }
  EXPECT_EQ(references, 0);
}

TEST(Codec, SmallBufferIsRefused) {
  const auto cloud = sample_cloud();
  std::vector<std::byte> bytes(encoded_size(cloud) - 1);
  EXPECT_EQ(encode(cloud, bytes), 0u);
  EXPECT_EQ(MessageEncoder(cloud).write(bytes), 0u);
}

TEST(TypeInfo, NamesConstantsAndDefaults) {
  const TypeInfo& info = type_info<PointCloud2>();
  EXPECT_EQ(info.ros_name, "sensor_msgs/msg/PointCloud2");
  EXPECT_EQ(info.dds_name, "sensor_msgs::msg::dds_::PointCloud2_");
  EXPECT_THAT(std::string(info.schema), testing::HasSubstr("uint8 FLOAT32=7\n"));
  EXPECT_EQ(type_info<rcl_interfaces::srv::ListParameters_Request>().dds_name,
            "rcl_interfaces::srv::dds_::ListParameters_Request_");
  EXPECT_EQ(rcl_interfaces::msg::Log::FATAL, 50);
  EXPECT_EQ(geometry_msgs::msg::Quaternion{}.w, 1.0);
  EXPECT_THAT(std::string(type_info<geometry_msgs::msg::Quaternion>().schema), testing::HasSubstr("float64 w 1\n"));
}

TEST(TypeInfo, HumbleAndJazzyShareAWireName) {
  namespace rmw = rmw_dds_common;
  EXPECT_EQ(type_info<rmw::msg::ParticipantEntitiesInfo>().dds_name,
            type_info<rmw::msg_humble::ParticipantEntitiesInfo>().dds_name);
  EXPECT_EQ(encoded_size(rmw::msg_humble::Gid{}), 28u);
  EXPECT_EQ(encoded_size(rmw::msg::Gid{}), 20u);
  const MessageType* humble = find_type("rmw_dds_common/msg/Gid", "humble");
  ASSERT_NE(humble, nullptr);
  EXPECT_EQ(humble->default_sample().size(), 28u);
  EXPECT_EQ(find_type("rmw_dds_common::msg::dds_::Gid_")->default_sample().size(), 20u);
  EXPECT_EQ(find_type("rmw_dds_common/msg/Gid", "foxy"), nullptr);
}

TEST(TypeRegistry, DefaultSamplesSurviveTheirOwnOperations) {
  EXPECT_GE(all_types().size(), 70u);
  for (const MessageType& type : all_types()) {
    SCOPED_TRACE(type.info->ros_name);
    const auto sample = type.default_sample();
    std::vector<std::byte> again;
    EXPECT_EQ(type.reencode(sample, again), DecodeStatus::ok);
    EXPECT_EQ(again, sample);
    std::string json;
    EXPECT_EQ(type.to_json(sample, json, {}), DecodeStatus::ok);
    EXPECT_EQ(json.front(), '{');
  }
}

TEST(Json, TextNumbersAndLimits) {
  const auto json = [](const auto& value, JsonOptions options = {}) {
    std::string out;
    JsonWriter(out, options).write(value);
    return out;
  };
  EXPECT_EQ(json(1.0), "1.0");
  EXPECT_EQ(json(0.1f), "0.100000001");
  EXPECT_EQ(json(1e300), "1.0000000000000001e+300");
  EXPECT_EQ(json(-0.0), "-0.0");
  EXPECT_EQ(json(std::numeric_limits<double>::quiet_NaN()), "\"nan\"");
  EXPECT_EQ(json(-std::numeric_limits<float>::infinity()), "\"-inf\"");
  EXPECT_EQ(json(std::uint8_t{200}), "200");
  EXPECT_EQ(json(std::numeric_limits<std::int64_t>::min()), "-9223372036854775808");
  EXPECT_EQ(json(std::string("a\"\\\n\xc3\xa4\xff")), "\"a\\\"\\\\\\u000a\xc3\xa4\\ufffd\"");
  EXPECT_EQ(json(Blob{1, 2, 3}, {2}), "[1, 2, \"... 1 more\"]");
  EXPECT_EQ(json(std::vector<bool>{true, false}), "[true, false]");
  builtin_interfaces::msg::Time time;
  time.sec = -1;
  EXPECT_EQ(json(time), "{\"sec\": -1, \"nanosec\": 0}");
}

}  // namespace
}  // namespace adit
