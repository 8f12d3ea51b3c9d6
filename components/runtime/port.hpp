// What a port is to everybody who is not its component: a name, a topic, a type, a QoS and counters.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "idl/type_info.hpp"
#include "middleware/graph.hpp"
#include "middleware/qos.hpp"

namespace adit {

enum class WhenFull {
  drop_oldest,  // the newest messages win
  drop_newest,  // the oldest messages win
  block,        // the publisher waits, at most its qos.max_blocking; then its message is dropped
};
std::string_view to_string(WhenFull when_full);

// How many messages may wait for a handler, and what happens to one more. Every drop is counted.
struct Queue {
  std::size_t size = 10;
  WhenFull when_full = WhenFull::drop_oldest;
};

struct PortInfo {
  enum class Direction { input, output };
  Direction direction{};
  std::string component;  // fully qualified: "/perception/lidar_odometry"
  std::string name;       // as the component calls it: "points"
  std::string topic;      // resolved: "/lidar/points"
  const TypeInfo* type = nullptr;
  Qos qos;
  Queue queue;  // inputs
};

struct InputStats {
  std::uint64_t handled = 0;      // messages the handler has seen
  std::uint64_t dropped = 0;      // at the queue, by its WhenFull
  std::uint64_t refused = 0;      // could not be decoded
  std::uint64_t waiting = 0;      // in the queue now
  std::uint64_t pool_misses = 0;  // messages that came from the heap because all pooled ones were held
  std::string last_refusal;       // why the last one was refused
  LinkStats link;                 // of the DDS reader; zero without one
};

struct OutputStats {
  std::uint64_t published = 0;  // accepted by publish()
  std::uint64_t refused = 0;    // published while not active, or refused by the middleware
  std::uint64_t pool_misses = 0;
  std::uint32_t local_readers = 0;  // inputs of this process
  LinkStats link;
};

// "points" in namespace "/perception" -> "/perception/points"; "/points" stays; "~/points" -> under the component.
std::string resolve_name(std::string_view name, std::string_view namespace_, std::string_view component);

}  // namespace adit
