// Checks of the machine an operator can act on: each finding comes with its fix.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "middleware/config.hpp"

namespace adit::doctor {

struct Finding {
  enum class Level { ok, warning, failure };
  Level level = Level::ok;
  std::string check;    // "kernel socket buffers"
  std::string finding;  // "net.core.rmem_max is 212992"
  std::string fix;      // empty when ok
};

// What the checks read; tests put a folder of their own in its place.
struct Machine {
  std::string proc = "/proc";
  std::string shm = "/dev/shm";
};

Finding check_socket_buffers(const Machine& machine, std::size_t wanted_bytes);
Finding check_shared_memory(const Machine& machine, std::size_t wanted_bytes);
// Segments that no living process maps: left by a crash. Reported, never deleted: their names carry no owner.
Finding check_stale_segments(const Machine& machine);
Finding check_interface(const std::string& network);
Finding check_clock();
Finding check_realtime_permission();
Finding check_locked_memory();
Finding check_roudi();
// Opens a participant of each built-in vendor with these settings.
std::vector<Finding> check_vendors(const ParticipantConfig& config);
// Pairs of endpoints in the running domain whose QoS does not match.
std::vector<Finding> check_domain(const ParticipantConfig& config);

// All of them in the order of the declarations.
std::vector<Finding> examine(const Machine& machine, const ParticipantConfig& config);

std::string to_text(const std::vector<Finding>& findings);

}  // namespace adit::doctor
