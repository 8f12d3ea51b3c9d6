// A domain participant on Cyclone DDS, and what its writers and readers share with it.
#pragma once

#include <dds/dds.h>

#include <atomic>
#include <map>
#include <mutex>
#include <set>
#include <vector>

#include "middleware/cyclonedds/configuration.hpp"
#include "middleware/cyclonedds/discovery.hpp"
#include "middleware/participant.hpp"

namespace adit::cyclonedds {

Error to_error(dds_return_t code, const std::string& doing);
Gid gid_of(dds_entity_t entity);

// Delivers events to whoever listens now. Thread-safe; the mutex is held while the handler runs, so that a replaced
// handler is not running any more when set() returns.
class EventHub {
 public:
  void set(EventHandler handler);
  void emit(const Event& event);

 private:
  std::mutex mutex_;
  EventHandler handler_;
};

// Owned by the participant; outlives its writers and readers.
struct ParticipantState {
  ParticipantConfig config;
  Configuration configuration;
  dds_entity_t domain = 0;
  dds_entity_t participant = 0;
  Gid gid;
  Discovery discovery;
  EventHub events;

  // A topic entity for one endpoint; it may be deleted as soon as the endpoint is created. `type` gets the sertype to
  // make samples with. Refuses a second type on a topic of this participant.
  Result<dds_entity_t> open_topic(const EndpointConfig& config, const ddsi_sertype*& type);
  void close_topic(const std::string& topic);

 private:
  struct TopicUse {
    std::string type;
    std::size_t endpoints = 0;
  };
  std::mutex topics_mutex_;
  std::map<std::string, TopicUse> topics_;
};

// The matches and the troubles of one writer or reader, from Cyclone's listener calls.
class EndpointWatch {
 public:
  EndpointWatch(ParticipantState& state, const EndpointConfig& config, bool is_writer)
      : state_(state), config_(config), is_writer_(is_writer) {}

  // Calls on Cyclone's threads come until the entity created with this listener is deleted.
  struct ListenerDeleter {
    void operator()(dds_listener_t* listener) const { dds_delete_listener(listener); }
  };
  std::unique_ptr<dds_listener_t, ListenerDeleter> make_listener();
  // The entity made with the listener can be asked now: matches of its creation are counted and told here.
  void created(dds_entity_t entity);

  std::uint32_t matched() const { return matched_.load(std::memory_order_relaxed); }
  bool has_remote() const { return remote_.load(std::memory_order_relaxed) > 0; }
  void lost(const Gid& local, const Gid& writer, std::uint64_t count);
  void deadline_missed(const Gid& local);

 private:
  void on_match(dds_entity_t entity, dds_instance_handle_t handle, int change);
  void match(dds_entity_t entity, dds_instance_handle_t handle, int change);
  void mismatch(dds_entity_t entity, std::uint32_t policy_id);
  void liveliness_lost(dds_entity_t entity, dds_instance_handle_t handle);
  Gid remote_gid(dds_entity_t entity, dds_instance_handle_t handle) const;
  Event event(Event::Kind kind, const Gid& local, const Gid& remote) const;
  void emit(Event event);

  ParticipantState& state_;
  const EndpointConfig& config_;
  const bool is_writer_;
  std::atomic<std::uint32_t> matched_ = 0;
  std::atomic<std::uint32_t> remote_ = 0;
  std::mutex match_mutex_;  // one match after the other; guards the two below
  bool created_ = false;
  std::vector<std::pair<dds_instance_handle_t, int>> early_matches_;
  std::mutex mutex_;  // guards the two below
  std::map<dds_instance_handle_t, Gid> peers_;
  std::set<Gid> reported_;  // endpoints whose mismatch has been told
};

Result<std::unique_ptr<Participant>> open_participant(const ParticipantConfig& config, std::string_view user_data);
Result<std::unique_ptr<Writer>> make_writer(ParticipantState& state, const EndpointConfig& config);
Result<std::unique_ptr<Reader>> make_reader(ParticipantState& state, const EndpointConfig& config);

}  // namespace adit::cyclonedds
