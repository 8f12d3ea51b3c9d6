#include "bringup/commands/graph_table.hpp"

#include <gmock/gmock.h>

namespace adit {
namespace {

using testing::HasSubstr;
using testing::Not;

EndpointInfo endpoint(const std::string& node, bool is_writer, const Qos& qos,
                      const std::string& type = "std_msgs/msg/String") {
  EndpointInfo info;
  info.topic = "/chatter";
  info.dds_topic = "rt/chatter";
  info.type = info.dds_type = type;
  info.node = node;
  info.is_writer = is_writer;
  info.qos = qos;
  info.history_known = true;
  return info;
}

TEST(GraphTable, ListsTopicsWithCountsAndTypeConflicts) {
  Graph graph;
  graph.endpoints = {endpoint("/a", true, Qos::sensor()), endpoint("/b", false, Qos::sensor(), "other/msg/Type")};
  EXPECT_EQ(topic_list(graph, false), "/chatter\n");
  EXPECT_THAT(topic_list(graph, true), HasSubstr("1 writers, 1 readers"));
  EXPECT_THAT(topic_list(graph, true), HasSubstr("different types"));
}

TEST(GraphTable, DetailsNameEveryFailingPolicyOfEveryPair) {
  Graph graph;
  graph.endpoints = {endpoint("/camera", true, Qos::sensor()), endpoint("/viewer", false, Qos::latched()),
                     endpoint("/logger", false, Qos::sensor())};
  const std::string text = topic_details(graph, "/chatter");
  EXPECT_THAT(text, HasSubstr("MISMATCH /camera -> /viewer: reliability offered best effort, requested reliable"));
  EXPECT_THAT(text, HasSubstr("MISMATCH /camera -> /viewer: durability"));
  EXPECT_THAT(text, Not(HasSubstr("-> /logger")));
  EXPECT_EQ(topic_details(graph, "/nothing"), "");
}

TEST(GraphTable, NodeDetailsShowWhatItWritesAndReads) {
  Graph graph;
  graph.endpoints = {endpoint("/a", true, Qos::sensor()), endpoint("/a", false, Qos::reliable())};
  EXPECT_THAT(node_details(graph, "/a"), HasSubstr("writes /chatter"));
  EXPECT_THAT(node_details(graph, "/a"), HasSubstr("reads  /chatter"));
  EXPECT_EQ(node_details(graph, "/b"), "");
}

}  // namespace
}  // namespace adit
