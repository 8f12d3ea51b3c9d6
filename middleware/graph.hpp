// Who is out there: participants, nodes and endpoints of the domain, as discovery told us.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "middleware/qos.hpp"
#include "middleware/sample.hpp"

namespace adit {

struct ParticipantInfo {
  Gid gid;
  std::string name;     // empty when not announced
  std::string enclave;  // "/" of "enclave=/;"; empty: not a ROS participant
  std::string vendor;   // "Fast DDS", "Cyclone DDS", "vendor 01.xx"
  bool local = false;   // this very participant
};

struct EndpointInfo {
  Gid gid;
  bool is_writer = false;
  std::string dds_topic;  // "rt/lidar/points"
  std::string dds_type;
  std::string topic;      // "/lidar/points"; the DDS name for what is not a ROS topic
  std::string type;       // "sensor_msgs/msg/PointCloud2"; the DDS name where it is not of ROS form
  std::string type_hash;  // empty: not announced (Humble)
  std::string node;       // "/perception/lidar"; empty: unknown
  Qos qos;
  bool history_known = false;  // qos.depth was announced (Cyclone does, Fast DDS 2.9 does not)
};

struct Graph {
  std::vector<ParticipantInfo> participants;
  std::vector<EndpointInfo> endpoints;
  std::vector<std::string> nodes;  // fully qualified, sorted, without duplicates
};

// Something that happened to one of our endpoints.
struct Event {
  enum class Kind { matched, unmatched, qos_mismatch, deadline_missed, liveliness_lost, samples_lost };
  Kind kind{};
  std::string topic;
  bool is_writer = false;            // which of our endpoints of that topic
  Gid local, remote;                 // remote is zero where the vendor does not name it
  std::uint64_t count = 0;           // samples_lost: how many
  std::vector<Mismatch> mismatches;  // qos_mismatch: every failing policy
  std::string text;                  // the whole of it for a person, remedy included
};
using EventHandler = std::function<void(const Event&)>;

// Monotonic counters of one endpoint since its creation. Nothing is lost without one of them moving.
struct LinkStats {
  std::uint64_t sent = 0;  // writer: samples handed to the vendor
  std::uint64_t sent_bytes = 0;
  std::uint64_t send_failed = 0;  // writer: the vendor refused (time-out, out of memory)
  std::uint64_t received = 0;     // reader: samples that reached take()
  std::uint64_t received_bytes = 0;
  std::uint64_t lost = 0;         // reader: gaps in the writers' sequences
  std::uint64_t overwritten = 0;  // reader: arrived, but replaced by newer ones before they were taken
  std::uint64_t rejected = 0;     // reader: arrived, but refused (resource limits, wrong encapsulation)
  std::uint32_t matched = 0;      // endpoints matched now
};

}  // namespace adit
