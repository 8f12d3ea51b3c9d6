// What shall go wrong, as a value.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "middleware/time.hpp"

namespace adit {

enum class FaultSide { writing, reading };

// Faults of the samples of some topics on one side. Probabilities are per sample, from 0 to 1; a sample may meet
// several faults, in the order of the members.
struct FaultRule {
  std::string topic = "*";  // EndpointConfig::topic, or a beginning of it followed by '*'
  FaultSide side = FaultSide::reading;

  Duration mute_after{};  // silence from this long after the participant was wrapped, ...
  Duration mute_for{};    // ... for this long; 0: none
  double drop = 0.0;
  std::uint32_t drop_every = 0;  // the n-th, 2n-th, ... sample; 0: none
  double truncate = 0.0;         // cut off at a random place behind the encapsulation header
  double corrupt = 0.0;          // flip bits behind the encapsulation header
  std::uint32_t corrupt_bits = 1;
  double duplicate = 0.0;
  Duration delay{};      // of every sample, ...
  Duration jitter{};     // ... and up to this much more, evenly distributed
  double reorder = 0.0;  // held back until the next sample has passed, or for reorder_hold
  Duration reorder_hold = std::chrono::milliseconds(100);
};

// The same seed, endpoints created in the same order and the same samples meet the same faults. (When delayed samples
// arrive depends on the clock, of course.)
struct FaultPlan {
  std::uint64_t seed = 1;
  std::vector<FaultRule> rules;
};

struct FaultCounters {
  std::uint64_t samples = 0;  // that came to the rules
  std::uint64_t muted = 0, dropped = 0, truncated = 0, corrupted = 0, duplicated = 0, delayed = 0, reordered = 0;
  friend bool operator==(const FaultCounters&, const FaultCounters&) = default;
};

}  // namespace adit
