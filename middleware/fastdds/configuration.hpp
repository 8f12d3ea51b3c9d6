// From a ParticipantConfig to the vendor's participant QoS: transports, discovery, security; and the text that says it.
#pragma once

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>

#include "middleware/config.hpp"
#include "middleware/fastdds/late_announcement.hpp"

namespace adit::fastdds {

struct Configuration {
  eprosima::fastdds::dds::DomainParticipantQos qos;
  LateAnnouncement::Audible audible;                // to set when the participant is created
  std::shared_ptr<FirstHeartbeat> first_heartbeat;  // null with security: what we would say must be signed
  bool loopback = true;
  std::string explanation;  // one "name: value" line each, warnings included
};

// Fails for an interface or keystore that cannot be used; what only costs speed (small kernel buffers, no shared
// memory) is a warning in the explanation.
Result<Configuration> configure(const ParticipantConfig& config, std::string_view user_data);

}  // namespace adit::fastdds
