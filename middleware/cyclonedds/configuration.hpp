// ParticipantConfig to Cyclone's configuration text. Everything that can be refused is refused here, before Cyclone
// opens a socket.
#pragma once

#include <string>
#include <vector>

#include "middleware/config.hpp"

namespace adit::cyclonedds {

struct Configuration {
  std::string xml;                 // for dds_create_domain
  std::string interface;           // "lo (127.0.0.1)"
  std::size_t receive_buffer = 0;  // bytes the kernel granted
  std::size_t send_buffer = 0;
  std::size_t fragment_bytes = 0;
  std::uint32_t last_participant_index = 0;
  bool multicast = false;
  std::vector<std::string> peers;
  std::vector<std::string> warnings;  // one clear line each, with what to do
};

Result<Configuration> make_configuration(const ParticipantConfig& config);

}  // namespace adit::cyclonedds
