// What `adit topic` and `adit node` show of a graph.
#pragma once

#include <memory>
#include <string>

#include "middleware/participant.hpp"

namespace adit {

// The graph once discovery has come to rest (unchanged for 300 ms, every ROS endpoint's node known), at most `limit`
// after the call.
Graph settled_graph(const Participant& participant, Duration limit);

// Joins as `config` says, waits for the graph to settle and leaves.
Result<Graph> observe(const ParticipantConfig& config, double limit_s);

std::string topic_list(const Graph& graph, bool with_types);
// Every endpoint of a topic with node, QoS and hash, then every pair whose QoS does not match and why; empty when there
// is no such topic.
std::string topic_details(const Graph& graph, const std::string& topic);
std::string node_list(const Graph& graph);
std::string node_details(const Graph& graph, const std::string& node);

}  // namespace adit
