// The samples of `ros_discovery_info`: which node owns which endpoint of a participant.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "idl/type_info.hpp"
#include "middleware/sample.hpp"

namespace adit {

struct NodeEndpoints {
  std::vector<Gid> readers;
  std::vector<Gid> writers;
};

// What one participant says of itself. Nodes by fully qualified name.
struct DiscoveryInfo {
  Gid participant;
  std::map<std::string, NodeEndpoints> nodes;
};

// Humble sends gids of 24 bytes (16 and 8 zeros), every later distribution of 16; the topic and type names are the
// same.
enum class GidForm { humble_24, iron_16 };

const TypeInfo& discovery_type(GidForm form);
// A serialized rmw_dds_common/msg/ParticipantEntitiesInfo.
std::vector<std::byte> encode_discovery(const DiscoveryInfo& info, GidForm form);
// Reads either form, told apart by the zeros behind the participant's gid. False for anything malformed.
bool decode_discovery(Bytes sample, DiscoveryInfo& info);

}  // namespace adit
