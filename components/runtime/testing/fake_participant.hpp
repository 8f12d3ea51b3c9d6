// A middleware in memory, for tests: participants of one FakeDomain exchange serialized samples without DDS.
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "middleware/participant.hpp"

namespace adit::testing {

class FakeReader;
class FakeWriter;

// Keeps last `depth` samples per reader and, when latched, per writer; honours QoS matching and ignore_local.
// Everything is delivered before publish() returns. Outlives its participants.
class FakeDomain {
 public:
  std::unique_ptr<Participant> join(const ParticipantConfig& config = {});

 private:
  friend class FakeParticipant;
  friend class FakeReader;
  friend class FakeWriter;
  std::mutex mutex_;
  std::vector<FakeReader*> readers_;
  std::vector<FakeWriter*> writers_;
  std::uint8_t next_participant_ = 1;
  std::uint8_t next_entity_ = 1;
};

}  // namespace adit::testing
