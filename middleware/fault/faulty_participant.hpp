// A participant some of whose samples get lost, late, doubled or damaged.
#pragma once

#include <map>
#include <mutex>

#include "middleware/fault/fault_line.hpp"
#include "middleware/participant.hpp"

namespace adit {

// Endpoints that no rule names are the inner participant's own. Thread-safe.
class FaultyParticipant final : public Participant {
 public:
  FaultyParticipant(std::unique_ptr<Participant> inner, FaultPlan plan);

  // Silence on all endpoints of `topic` (as in FaultRule) and side, present and future, until unmute(). The endpoint
  // must be under some rule, be it an empty one.
  void mute(const std::string& topic, FaultSide side);
  void unmute(const std::string& topic, FaultSide side);
  // Sum over the endpoints of `topic` and side that exist or existed.
  FaultCounters counters(const std::string& topic, FaultSide side) const;

  Result<std::unique_ptr<Writer>> writer(const EndpointConfig& config) override;
  Result<std::unique_ptr<Reader>> reader(const EndpointConfig& config) override;
  Graph graph() const override { return inner_->graph(); }
  void on_event(EventHandler handler) override { inner_->on_event(std::move(handler)); }
  std::string explain() const override;
  const ParticipantConfig& config() const override { return inner_->config(); }
  Gid gid() const override { return inner_->gid(); }

 private:
  struct Line {
    std::string topic;
    FaultSide side{};
    std::shared_ptr<fault::FaultLine> line;
  };

  std::vector<FaultRule> rules_of(const std::string& topic, FaultSide side) const;
  std::shared_ptr<fault::FaultLine> make_line(const EndpointConfig& config, FaultSide side,
                                              std::vector<FaultRule> rules, fault::FaultLine::Deliver deliver);
  void set_muted(const std::string& topic, FaultSide side, bool on);

  const std::unique_ptr<Participant> inner_;
  const FaultPlan plan_;
  const fault::DelayThread::Instant start_;
  const std::shared_ptr<fault::DelayThread> delays_;
  mutable std::mutex mutex_;
  std::vector<Line> lines_;
  std::vector<std::pair<std::string, FaultSide>> muted_;
};

std::unique_ptr<FaultyParticipant> wrap_with_faults(std::unique_ptr<Participant> inner, FaultPlan plan);

}  // namespace adit
