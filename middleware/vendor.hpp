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

// Entry point of a vendor's shared module, found by this name with dlsym. A vendor's source defines it as
// `extern "C" const adit::VendorModule* ADIT_VENDOR_ENTRY_POINT()`: adit_vendor() in CMakeLists.txt sets the name,
// which carries the vendor's in static builds.
inline constexpr const char* vendor_entry_point = "adit_vendor_module";
using VendorEntryPoint = const VendorModule* (*)();

// The bare vendor by name, loaded on first use, without the ROS layer. Thread-safe.
Result<const VendorModule*> load_vendor(std::string_view name);

}  // namespace adit
