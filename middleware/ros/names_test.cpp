#include "middleware/ros/names.hpp"

#include <gtest/gtest.h>

namespace adit {
namespace {

TEST(RosNames, TopicsMapToDdsAndBack) {
  EXPECT_EQ(to_dds_topic("/lidar/points"), "rt/lidar/points");
  EXPECT_EQ(to_dds_topic("ros_discovery_info"), "ros_discovery_info");
  EXPECT_EQ(from_dds_topic("rt/lidar/points"), "/lidar/points");
  EXPECT_EQ(from_dds_topic("rq/robot/get_parametersRequest"), "rq/robot/get_parametersRequest");
}

TEST(RosNames, TypesLoseTheirDdsForm) {
  EXPECT_EQ(from_dds_type("sensor_msgs::msg::dds_::PointCloud2_"), "sensor_msgs/msg/PointCloud2");
  EXPECT_EQ(from_dds_type("HelloWorldData::Msg"), "HelloWorldData::Msg");
}

TEST(RosNames, OnlyRosNamesAreValid) {
  for (const char* good : {"/a", "/lidar/points", "/_x/y2"}) EXPECT_TRUE(validate_ros_name(good)) << good;
  for (const char* bad : {"", "/", "a", "/a/", "//a", "/2a", "/a b", "/a/3", "/\xc3\xa4"}) {
    EXPECT_FALSE(validate_ros_name(bad)) << bad;
  }
}

TEST(RosNames, NodeNamesSplitAndJoin) {
  EXPECT_EQ(split_node_name("/perception/lidar").node_namespace, "/perception");
  EXPECT_EQ(split_node_name("/perception/lidar").name, "lidar");
  EXPECT_EQ(split_node_name("/lidar").node_namespace, "/");
  EXPECT_EQ(join_node_name("/", "lidar"), "/lidar");
  EXPECT_EQ(join_node_name("/perception", "lidar"), "/perception/lidar");
}

TEST(RosNames, UserDataValuesAreFoundByKey) {
  EXPECT_EQ(user_data_value("enclave=/;", "enclave"), "/");
  EXPECT_EQ(user_data_value("serviceid= 1.10;typehash=RIHS01_ab;", "typehash"), "RIHS01_ab");
  EXPECT_EQ(user_data_value("typehash=RIHS01_ab", "typehash"), "RIHS01_ab");
  EXPECT_EQ(user_data_value("", "typehash"), "");
  EXPECT_EQ(user_data_value("xtypehash=1;", "typehash"), "");
}

}  // namespace
}  // namespace adit
