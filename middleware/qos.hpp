// Quality of service as a value, with the profiles ROS 2 uses, and the check that says in full why two do not match.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "idl/result.hpp"
#include "middleware/time.hpp"

namespace adit {

struct Qos {
  enum class Reliability { best_effort, reliable };
  enum class Durability { volatile_, transient_local };
  enum class Liveliness { automatic, manual_by_topic };

  Reliability reliability = Reliability::reliable;
  Durability durability = Durability::volatile_;
  std::uint32_t depth = 10;          // samples kept per endpoint (KEEP_LAST); 0 = KEEP_ALL
  std::optional<Duration> deadline;  // none = infinite, for these three
  std::optional<Duration> lifespan;
  std::optional<Duration> lease;
  Liveliness liveliness = Liveliness::automatic;
  Duration max_blocking = std::chrono::milliseconds(100);  // how long a reliable publish may wait for space

  // The profiles of rmw (qos_profiles.h) by their values.
  static Qos sensor();                            // best effort, volatile, keep last 5
  static Qos reliable(std::uint32_t depth = 10);  // rclcpp's default QoS(depth)
  static Qos latched(std::uint32_t depth = 1);    // reliable, transient local: a late joiner gets the last `depth`
  static Qos clock();                             // best effort, volatile, keep last 1
  static Qos rosout();                            // reliable, transient local, keep last 1000, lifespan 10 s
  static Qos tf();                                // reliable, volatile, keep last 100

  friend bool operator==(const Qos&, const Qos&) = default;
};

// "reliable, transient local, keep last 1, deadline 100 ms": what logs and tools print.
std::string to_string(const Qos& qos);

// A value that no vendor could honour: lease <= 0, deadline < 0, ...
Result<void> validate(const Qos& qos);

// One policy in which a reader asks for more than a writer offers.
struct Mismatch {
  std::string policy;     // "reliability"
  std::string offered;    // "best effort"
  std::string requested;  // "reliable"
  std::string remedy;     // what to change, on which side
  friend bool operator==(const Mismatch&, const Mismatch&) = default;
};

// Every failing policy by the request/offer rules of DDS 1.4, section 2.2.3; empty when they match.
std::vector<Mismatch> check(const Qos& offered, const Qos& requested);

}  // namespace adit
