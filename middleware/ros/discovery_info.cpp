#include "middleware/ros/discovery_info.hpp"

#include <algorithm>

#include "idl/codec.hpp"
#include "middleware/ros/names.hpp"
#include "rmw_dds_common/msg/participant_entities_info.hpp"
#include "rmw_dds_common/msg_humble/participant_entities_info.hpp"

namespace adit {
namespace {

using Humble = rmw_dds_common::msg_humble::ParticipantEntitiesInfo;
using Iron = rmw_dds_common::msg::ParticipantEntitiesInfo;

template <class WireGid>
WireGid to_wire(const Gid& gid) {
  WireGid wire{};  // Humble's last 8 bytes stay 0
  std::copy(gid.bytes.begin(), gid.bytes.end(), wire.data.begin());
  return wire;
}

template <class WireGid>
Gid from_wire(const WireGid& wire) {
  Gid gid;
  std::copy_n(wire.data.begin(), gid.bytes.size(), gid.bytes.begin());
  return gid;
}

template <class Message>
std::vector<std::byte> encode_as(const DiscoveryInfo& info) {
  using WireGid = decltype(Message{}.gid);
  Message message;
  message.gid = to_wire<WireGid>(info.participant);
  for (const auto& [name, endpoints] : info.nodes) {
    auto& node = message.node_entities_info_seq.emplace_back();
    const NodeName split = split_node_name(name);
    node.node_namespace = split.node_namespace;
    node.node_name = split.name;
    for (const Gid& gid : endpoints.readers) node.reader_gid_seq.push_back(to_wire<WireGid>(gid));
    for (const Gid& gid : endpoints.writers) node.writer_gid_seq.push_back(to_wire<WireGid>(gid));
  }
  std::vector<std::byte> bytes(encoded_size(message));
  bytes.resize(encode(message, bytes));
  return bytes;
}

template <class Message>
bool decode_as(Bytes sample, DiscoveryInfo& info) {
  Message message;
  if (decode(sample, message) != DecodeStatus::ok) return false;
  info.participant = from_wire(message.gid);
  info.nodes.clear();
  for (const auto& node : message.node_entities_info_seq) {
    NodeEndpoints& endpoints = info.nodes[join_node_name(node.node_namespace, node.node_name)];
    for (const auto& gid : node.reader_gid_seq) endpoints.readers.push_back(from_wire(gid));
    for (const auto& gid : node.writer_gid_seq) endpoints.writers.push_back(from_wire(gid));
  }
  return true;
}

// In the 24-byte form 8 zeros follow the gid and then the sequence length; in the 16-byte form an empty sequence ends
// the sample where those zeros would be, and a filled one begins with a length that is not 0.
bool is_humble(Bytes sample) {
  constexpr std::size_t zeros_begin = 4 + 16;
  constexpr std::size_t zeros_end = zeros_begin + 8;
  return sample.size() >= zeros_end + 4 && std::all_of(sample.begin() + zeros_begin, sample.begin() + zeros_end,
                                                       [](std::byte b) { return b == std::byte{0}; });
}

}  // namespace

const TypeInfo& discovery_type(GidForm form) {
  return form == GidForm::humble_24 ? type_info<Humble>() : type_info<Iron>();
}

std::vector<std::byte> encode_discovery(const DiscoveryInfo& info, GidForm form) {
  return form == GidForm::humble_24 ? encode_as<Humble>(info) : encode_as<Iron>(info);
}

bool decode_discovery(Bytes sample, DiscoveryInfo& info) {
  return is_humble(sample) ? decode_as<Humble>(sample, info) : decode_as<Iron>(sample, info);
}

}  // namespace adit
