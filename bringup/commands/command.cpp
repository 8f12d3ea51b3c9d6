#include "bringup/commands/command.hpp"

#include <cstdio>

namespace adit {

void add_participant_options(CLI::App& app, ParticipantConfig& config) {
  app.add_option("--middleware", config.vendor, "fastdds or cyclonedds (default: the first one built in)")
      ->envname("ADIT_MIDDLEWARE");
  app.add_option("--domain", config.domain, "DDS domain, 0 to 232")
      ->envname("ADIT_DOMAIN")
      ->check(CLI::Range(0, 232))
      ->capture_default_str();
  app.add_option("--network", config.network, "loopback, or an interface by name or address")
      ->envname("ADIT_NETWORK")
      ->capture_default_str();
  app.add_option("--peer", config.peers, "address of another host to look for (repeatable)");
  app.add_flag("--multicast", config.multicast, "look for other hosts by multicast on that interface");
  app.add_option("--ros-distro", config.ros_distro, "form of the ROS graph: humble, iron, jazzy or none")
      ->capture_default_str();
}

ExitCode fail(const Error& error) {
  std::fprintf(stderr, "adit: %s\n", error.message.c_str());
  return 1;
}

}  // namespace adit
