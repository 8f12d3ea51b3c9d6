// DDS Security from an SROS2 keystore.
#pragma once

#include <dds/dds.h>

#include "middleware/config.hpp"

namespace adit::cyclonedds {

// Sets the participant's security properties: the built-in plug-ins of the distribution and the files of the enclave.
// Fails when a file is missing or cannot be read.
Result<void> secure(const SecurityConfig& config, dds_qos_t* participant_qos);

}  // namespace adit::cyclonedds
