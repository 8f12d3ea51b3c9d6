#include "bringup/commands/graph_table.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <thread>

namespace adit {
namespace {

struct TopicEntry {
  std::set<std::string> types;
  std::size_t writers = 0;
  std::size_t readers = 0;
};

std::map<std::string, TopicEntry> by_topic(const Graph& graph) {
  std::map<std::string, TopicEntry> topics;
  for (const EndpointInfo& endpoint : graph.endpoints) {
    TopicEntry& entry = topics[endpoint.topic];
    entry.types.insert(endpoint.type);
    ++(endpoint.is_writer ? entry.writers : entry.readers);
  }
  return topics;
}

std::string describe(const EndpointInfo& endpoint) {
  std::string qos = to_string(endpoint.qos);
  if (!endpoint.history_known) qos = qos.substr(0, qos.find(", keep")) + ", history not announced";
  return "  " + std::string(endpoint.is_writer ? "writer " : "reader ") +
         (endpoint.node.empty() ? "(node unknown)" : endpoint.node) + "\n    type  " + endpoint.type +
         (endpoint.type_hash.empty() ? "" : "\n    hash  " + endpoint.type_hash) + "\n    qos   " + qos +
         "\n    gid   " + to_string(endpoint.gid) + "\n";
}

// ROS participants name their nodes in a message of its own, which may arrive after their endpoints.
bool nodes_missing(const Graph& graph) {
  return std::any_of(graph.endpoints.begin(), graph.endpoints.end(), [&](const EndpointInfo& endpoint) {
    if (!endpoint.node.empty() || !endpoint.topic.starts_with('/')) return false;
    return std::any_of(graph.participants.begin(), graph.participants.end(), [&](const ParticipantInfo& participant) {
      return !participant.enclave.empty() && participant.gid.same_participant(endpoint.gid);
    });
  });
}

}  // namespace

Graph settled_graph(const Participant& participant, Duration limit) {
  using Steady = std::chrono::steady_clock;
  constexpr auto quiet = std::chrono::milliseconds(300);
  const auto end = Steady::now() + limit;
  auto changed = Steady::now();
  Graph graph = participant.graph();
  while (Steady::now() < end && Steady::now() - changed < quiet) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    Graph next = participant.graph();
    // A domain with only ourselves in it is not at rest but not found yet.
    if (next.participants.size() <= 1 || next.participants.size() != graph.participants.size() ||
        next.endpoints.size() != graph.endpoints.size() || next.nodes != graph.nodes || nodes_missing(next)) {
      changed = Steady::now();
    }
    graph = std::move(next);
  }
  return graph;
}

Result<Graph> observe(const ParticipantConfig& config, double limit_s) {
  Result<std::unique_ptr<Participant>> participant = open(config);
  if (!participant) return participant.error();
  return settled_graph(**participant, Duration(static_cast<std::int64_t>(limit_s * 1e9)));
}

std::string topic_list(const Graph& graph, bool with_types) {
  std::string text;
  for (const auto& [topic, entry] : by_topic(graph)) {
    text += topic;
    if (with_types) {
      for (const std::string& type : entry.types) text += "  " + type;
      text += "  " + std::to_string(entry.writers) + " writers, " + std::to_string(entry.readers) + " readers";
      if (entry.types.size() > 1) text += "  (different types: these endpoints do not match)";
    }
    text += "\n";
  }
  return text;
}

std::string topic_details(const Graph& graph, const std::string& topic) {
  std::string text;
  std::vector<const EndpointInfo*> writers, readers;
  for (const EndpointInfo& endpoint : graph.endpoints) {
    if (endpoint.topic != topic) continue;
    text += describe(endpoint);
    (endpoint.is_writer ? writers : readers).push_back(&endpoint);
  }
  for (const EndpointInfo* writer : writers) {
    for (const EndpointInfo* reader : readers) {
      if (writer->dds_type != reader->dds_type) continue;
      for (const Mismatch& mismatch : check(writer->qos, reader->qos)) {
        text += "  MISMATCH " + writer->node + " -> " + reader->node + ": " + mismatch.policy + " offered " +
                mismatch.offered + ", requested " + mismatch.requested + "; " + mismatch.remedy + "\n";
      }
    }
  }
  return text;
}

std::string node_list(const Graph& graph) {
  std::string text;
  for (const std::string& node : graph.nodes) text += node + "\n";
  return text;
}

std::string node_details(const Graph& graph, const std::string& node) {
  std::string text;
  for (const bool writers : {true, false}) {
    for (const EndpointInfo& endpoint : graph.endpoints) {
      if (endpoint.node != node || endpoint.is_writer != writers) continue;
      text += "  " + std::string(writers ? "writes " : "reads  ") + endpoint.topic + "  " + endpoint.type + "  (" +
              to_string(endpoint.qos) + ")\n";
    }
  }
  return text;
}

}  // namespace adit
