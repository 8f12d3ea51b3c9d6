// What discovery has told: the domain's participants and endpoints, our own included, and which pairs cannot match.
#pragma once

#include <map>
#include <mutex>
#include <set>

#include "middleware/config.hpp"
#include "middleware/graph.hpp"

namespace adit::fastdds {

// "Fast DDS", "Cyclone DDS", "vendor 01.42": by the first two bytes of a GUID.
std::string vendor_name(const Gid& gid);
// By the first two bytes of a GUID.
bool is_fast_dds(const Gid& gid);
// "/" of "enclave=/;"; empty when there is none. Humble's Fast DDS counts a terminating NUL in.
std::string value_of(std::string_view key, std::string_view user_data);

// Thread-safe; its mutex is a leaf: nothing is called while it is held.
class Discovery {
 public:
  Discovery() = default;

  void add(const ParticipantInfo& participant);
  void remove_participant(const Gid& gid);
  // Adds or updates an endpoint and returns one qos_mismatch event for each pair of it with an endpoint of ours that
  // became known to fail.
  std::vector<Event> add(const EndpointInfo& endpoint, bool ours);
  void remove_endpoint(const Gid& gid);
  Graph graph() const;

 private:
  struct Known {
    EndpointInfo info;
    bool ours = false;
  };

  mutable std::mutex mutex_;
  std::map<Gid, ParticipantInfo> participants_;
  std::map<Gid, Known> endpoints_;
  std::set<std::pair<Gid, Gid>> reported_;  // our endpoint, the other one
};

}  // namespace adit::fastdds
