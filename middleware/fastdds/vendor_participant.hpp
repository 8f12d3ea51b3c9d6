// The vendor's participant and what its endpoints share: topics, discovery, events.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <mutex>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>

#include "middleware/fastdds/configuration.hpp"
#include "middleware/fastdds/discovery.hpp"
#include "middleware/fastdds/event_queue.hpp"
#include "middleware/fastdds/values.hpp"

namespace adit::fastdds {

// Held by the participant, its endpoints and, through a destroyed reader, by samples that outlive them; the last one
// leaves the domain. Thread-safe.
class VendorParticipant final : private dds::DomainParticipantListener {
 public:
  static Result<std::shared_ptr<VendorParticipant>> open(const ParticipantConfig& config, std::string_view user_data);
  ~VendorParticipant() override;
  VendorParticipant(const VendorParticipant&) = delete;
  VendorParticipant& operator=(const VendorParticipant&) = delete;

  // The topic of that name, created on first use; `incompatible` when it exists with another type.
  Result<dds::Topic*> acquire_topic(const std::string& name, const TypeInfo& type);
  void release_topic(const std::string& name);

  // Our own endpoints, for the graph and for mismatch reports.
  void add_endpoint(const EndpointConfig& config, const Gid& gid, bool is_writer);
  void remove_endpoint(const Gid& gid) { discovery_.remove_endpoint(gid); }

  dds::Publisher& publisher() { return *publisher_; }
  dds::Subscriber& subscriber() { return *subscriber_; }
  EventQueue& events() { return events_; }
  // Our volatile reliable writer and a reader of another vendor; `last` is the newest sample that is not for it.
  void expect_first_heartbeat(const Gid& writer, const Gid& reader, std::uint64_t last);
  FirstHeartbeat* first_heartbeat() { return configuration_.first_heartbeat.get(); }
  Graph graph() const { return discovery_.graph(); }
  const ParticipantConfig& config() const { return config_; }
  bool loopback() const { return configuration_.loopback; }
  std::string explain() const;
  Gid gid() const { return gid_; }

 private:
  struct SharedTopic {
    dds::Topic* topic = nullptr;
    std::size_t users = 0;
  };

  VendorParticipant(const ParticipantConfig& config, Configuration configuration);

  void on_participant_discovery(dds::DomainParticipant*, rtps::ParticipantDiscoveryInfo&& discovered) override;
  void on_publisher_discovery(dds::DomainParticipant*, rtps::WriterDiscoveryInfo&& discovered) override;
  void on_subscriber_discovery(dds::DomainParticipant*, rtps::ReaderDiscoveryInfo&& discovered) override;
  void post(std::vector<Event> events);
  void remember_address(const rtps::ReaderProxyData& reader);

  const ParticipantConfig config_;
  const Configuration configuration_;
  dds::DomainParticipant* participant_ = nullptr;
  dds::Publisher* publisher_ = nullptr;
  dds::Subscriber* subscriber_ = nullptr;
  Gid gid_;
  Discovery discovery_;
  EventQueue events_;
  std::mutex addresses_mutex_;
  std::map<Gid, sockaddr_in> addresses_;  // of other vendors' reliable readers
  std::mutex topics_mutex_;
  std::map<std::string, SharedTopic> topics_;
};

}  // namespace adit::fastdds
