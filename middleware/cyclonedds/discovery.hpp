// What Cyclone's built-in topics tell of the domain.
#pragma once

#include <dds/dds.h>

#include "middleware/graph.hpp"

namespace adit::cyclonedds {

Gid to_gid(const dds_guid_t& guid);

// The three built-in readers of one participant. Thread-safe.
class Discovery {
 public:
  // Entities belong to the participant and go with it.
  Result<void> start(dds_entity_t participant);

  // Participants and endpoints as announced: DDS names only, no nodes.
  Graph graph() const;
  // Endpoints of one kind on one DDS topic.
  std::vector<EndpointInfo> endpoints(bool writers, const std::string& dds_topic) const;

 private:
  dds_entity_t participants_ = 0;
  dds_entity_t writers_ = 0;
  dds_entity_t readers_ = 0;
  Gid self_;
};

}  // namespace adit::cyclonedds
