// What a vendor's module offers to open(). Implemented in fastdds/ and cyclonedds/; not for use above middleware/.
#pragma once

#include <memory>

#include "middleware/participant.hpp"

namespace adit {

struct VendorModule {
  const char* name;     // "fastdds" | "cyclonedds"
  const char* version;  // of the vendor's library
  // `config.vendor` is this one. The returned participant takes EndpointConfig::topic as the raw DDS topic name and
  // puts EndpointConfig::user_data and, from `participant_user_data`, the participant's USER_DATA on the wire as given.
  Result<std::unique_ptr<Participant>> (*open)(const ParticipantConfig& config, std::string_view participant_user_data);
};

// Entry point of a vendor's shared module, found by this name with dlsym.
inline constexpr const char* vendor_entry_point = "adit_vendor_module";
using VendorEntryPoint = const VendorModule* (*)();

}  // namespace adit
