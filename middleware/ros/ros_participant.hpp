// Makes any participant look like an ordinary ROS 2 process: a decorator around a vendor's Participant.
#pragma once

#include <memory>

#include "middleware/participant.hpp"

namespace adit {

// Precondition: validate_ros_distro(inner->config().ros_distro). Wraps `inner`, which speaks raw DDS names. Topics get
// ROS names and the `typehash=` USER_DATA; endpoints are announced under their node on `ros_discovery_info` in the form
// of config.ros_distro ("none": not at all); graph() and events carry ROS names and nodes. The reader of the others'
// `ros_discovery_info` is made at the first graph() call, so a process that never asks does not pay for it, and node
// names may need a moment to arrive.
Result<std::unique_ptr<Participant>> make_ros_participant(std::unique_ptr<Participant> inner);

// The participant's USER_DATA that goes with it ("enclave=/;"), empty when ros_distro is "none".
std::string ros_participant_user_data(const ParticipantConfig& config);

// Refuses an unknown ros_distro.
Result<void> validate_ros_distro(const std::string& distro);

}  // namespace adit
