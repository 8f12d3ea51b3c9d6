// Our bytes against those of idlc's C back end and Cyclone DDS's CDR streams, little and big endian.
#include "tests/wire/idlc_encoder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <string>

#include "adit_msgs/msg/fusion_status.hpp"
#include "adit_msgs/msg/localizability.hpp"
#include "adit_msgs/msg/thermal_frame.hpp"
#include "diagnostic_msgs/msg/diagnostic_array.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "nav_msgs/msg/path.hpp"
#include "rcl_interfaces/msg/log.hpp"
#include "rcl_interfaces/msg/parameter_event.hpp"
#include "sensor_msgs/msg/camera_info.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/imu.hpp"
#include "sensor_msgs/msg/joint_state.hpp"
#include "sensor_msgs/msg/laser_scan.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "std_msgs/msg/empty.hpp"
#include "tests/wire/encoder_samples.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace adit {
namespace {

struct Free {
  void operator()(unsigned char* memory) const { std::free(memory); }
};

template <class T>
class IdlcEncoder : public testing::Test {};
using Types =
    testing::Types<std_msgs::msg::Empty, sensor_msgs::msg::PointCloud2, sensor_msgs::msg::Image,
                   sensor_msgs::msg::CameraInfo, sensor_msgs::msg::Imu, sensor_msgs::msg::LaserScan,
                   sensor_msgs::msg::JointState, nav_msgs::msg::Odometry, nav_msgs::msg::Path, tf2_msgs::msg::TFMessage,
                   diagnostic_msgs::msg::DiagnosticArray, rcl_interfaces::msg::Log, rcl_interfaces::msg::ParameterEvent,
                   adit_msgs::msg::ThermalFrame, adit_msgs::msg::Localizability, adit_msgs::msg::FusionStatus>;
TYPED_TEST_SUITE(IdlcEncoder, Types);

TYPED_TEST(IdlcEncoder, SameBytesAndItsBigEndianIsUnderstood) {
  std::string name(type_info<TypeParam>().ros_name);
  std::replace(name.begin(), name.end(), '/', ':');
  for (std::size_t at = 0; (at = name.find(':', at)) != std::string::npos; at += 2) name.insert(at, 1, ':');
  for (unsigned seed = 0; seed < 200; ++seed) {
    TypeParam message;
    test::Filler(seed).fill(message);
    std::vector<std::byte> ours(encoded_size(message));
    ASSERT_EQ(encode(message, ours), ours.size());

    unsigned char *little = nullptr, *big = nullptr;
    std::size_t size = 0;
    ASSERT_TRUE(idlc_reencode(name.c_str(), ours.data() + 4, ours.size() - 4, &little, &big, &size)) << name;
    const std::unique_ptr<unsigned char, Free> owned_little(little), owned_big(big);
    ASSERT_EQ(size, ours.size() - 4);
    ASSERT_TRUE(std::equal(little, little + size, reinterpret_cast<const unsigned char*>(ours.data()) + 4)) << seed;

    std::vector<std::byte> bigendian(4);
    for (std::size_t i = 0; i < size; ++i) bigendian.push_back(std::byte{big[i]});
    TypeParam decoded;
    ASSERT_EQ(decode(bigendian, decoded), DecodeStatus::ok);
    ASSERT_EQ(decoded, message);
  }
}

}  // namespace
}  // namespace adit
