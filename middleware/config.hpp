// What a participant and an endpoint are made from.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "idl/type_info.hpp"
#include "middleware/qos.hpp"

namespace adit {

// DDS Security with an SROS2-style keystore: enclaves/<enclave>/{identity_ca,cert,key,permissions_ca,governance,
// permissions}.*. The private key never leaves its file.
struct SecurityConfig {
  std::string keystore;
  std::string enclave = "/";
};

struct ParticipantConfig {
  std::string vendor;                // "fastdds" | "cyclonedds"; empty: $ADIT_MIDDLEWARE, else the first one built in
  std::uint32_t domain = 0;          // 0..232; two participants meet only in the same domain
  std::string name = "adit";         // shown by tools
  std::string network = "loopback";  // "loopback", or an interface by name or address; nothing else leaves the host
  std::vector<std::string> peers;    // static peers: addresses of other hosts to look for (no multicast needed)
  bool multicast = false;            // discovery by multicast on a real interface; loopback always uses unicast
  std::string ros_distro = "jazzy";  // "humble" (24-byte gids) | "iron" | "jazzy" | "none" (stay out of the ROS graph)
  bool shared_memory = true;         // Fast DDS: SHM transport; Cyclone DDS has none (its README)
  // Fast DDS segment. Opening touches all of it, about 0.7 ms per MB; in this one clouds of 4 MB lose nothing at 10 Hz.
  std::size_t shared_memory_bytes = 8u << 20;
  std::size_t socket_buffer_bytes = 4u << 20;  // asked for; what the kernel granted is in explain()
  std::optional<SecurityConfig> security;
};

struct EndpointConfig {
  std::string topic;               // "/lidar/points"; a name without leading '/' is taken as a raw DDS topic name
  const TypeInfo* type = nullptr;  // static storage
  Qos qos;
  std::string node = "/adit";  // fully qualified node that owns the endpoint in the ROS graph
  // Do not exchange samples with endpoints of the same participant: the component runtime hands those over itself.
  bool ignore_local = false;
  std::string user_data;  // DDS USER_DATA; the ROS layer fills it ("typehash=...;")
};

}  // namespace adit
