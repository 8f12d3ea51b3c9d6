// QoS profiles in the text rosbag2 stores with a topic: written for ROS 2 to replay with, and read back.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "idl/result.hpp"

namespace adit::dataset {

// What of a writer's profile a player can offer again. Deadline, lifespan and lease speak of the recorded writer's rate
// and are stored as "none".
struct BagQos {
  bool reliable = true;
  bool transient_local = false;
  std::uint32_t depth = 10;  // samples kept; 0: all
  friend bool operator==(const BagQos&, const BagQos&) = default;
};

// The list of the writers' profiles, each once, with rmw's numbers for the policies (what Humble writes and every later
// release reads).
std::string bag_qos_text(const std::vector<BagQos>& offered);

// What a player should offer so that every reader of the recorded writers matches it again: the profile of the text; of
// several, the strongest reliability and durability and the greatest depth. Empty text (old bags): reliable, keep last
// 10. Reads numbers (up to Iron) and words (Jazzy). Fails with `malformed` for anything else.
Result<BagQos> bag_qos_offer(const std::string& text);

}  // namespace adit::dataset
