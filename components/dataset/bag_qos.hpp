// QoS profiles in the text rosbag2 stores with a topic: written for ROS 2 to replay with, and read back.
#pragma once

#include <string>

#include "idl/result.hpp"
#include "middleware/qos.hpp"

namespace adit::dataset {

// A list of the one profile, with rmw's numbers for the policies (what Humble writes and every later release reads).
std::string bag_qos(const Qos& offered);

// What a player should offer so that every reader of the recorded writers matches it again: the profile of the text;
// of several, the strongest reliability and durability and the greatest depth. Deadline, lifespan and lease are left
// out: they speak of the recorded writer's rate, not of the player's. Empty text (old bags): reliable, keep last 10.
// Reads numbers (up to Iron) and words (Jazzy). Fails with `malformed` for anything else.
Result<Qos> bag_qos_offer(const std::string& text);

}  // namespace adit::dataset
