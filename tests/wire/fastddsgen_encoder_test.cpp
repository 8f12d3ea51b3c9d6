// Our bytes against those of the code that fastddsgen makes of the same .idl files.
#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <gtest/gtest.h>

#include <vector>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "diagnostic_msgs/msg/diagnostic_array.hpp"
#include "encoder_types.h"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "tests/wire/encoder_samples.hpp"

namespace {

template <class Ours, class Theirs>
void expect_same_bytes() {
  using eprosima::fastcdr::Cdr;
  for (unsigned seed = 0; seed < 200; ++seed) {
    Ours message;
    adit::test::Filler(seed).fill(message);
    std::vector<std::byte> ours(adit::encoded_size(message));
    ASSERT_EQ(adit::encode(message, ours), ours.size());

    eprosima::fastcdr::FastBuffer in(reinterpret_cast<char*>(ours.data()), ours.size());
    Cdr reader(in, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
    reader.read_encapsulation();
    Theirs theirs;
    theirs.deserialize(reader);

    std::vector<std::byte> bytes(ours.size());  // zeros: Fast CDR leaves the padding as it is
    eprosima::fastcdr::FastBuffer out(reinterpret_cast<char*>(bytes.data()), bytes.size());
    Cdr writer(out, Cdr::LITTLE_ENDIANNESS, Cdr::DDS_CDR);
    writer.serialize_encapsulation();
    theirs.serialize(writer);
    ASSERT_EQ(writer.getSerializedDataLength(), ours.size());
    ASSERT_EQ(bytes, ours) << seed;
  }
}

TEST(FastddsgenEncoder, SameBytes) {
  expect_same_bytes<adit::sensor_msgs::msg::PointCloud2, sensor_msgs::msg::PointCloud2>();
  expect_same_bytes<adit::nav_msgs::msg::Odometry, nav_msgs::msg::Odometry>();
  expect_same_bytes<adit::diagnostic_msgs::msg::DiagnosticArray, diagnostic_msgs::msg::DiagnosticArray>();
  expect_same_bytes<adit::adit_msgs::msg::ThermalFrame, adit_msgs::msg::ThermalFrame>();
}

}  // namespace
