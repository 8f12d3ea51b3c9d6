// Cyclone's listener calls to adit's events.
#include "middleware/cyclonedds/participant.hpp"
#include "middleware/cyclonedds/qos_mapping.hpp"

namespace adit::cyclonedds {
namespace {

struct EndpointDeleter {
  void operator()(dds_builtintopic_endpoint_t* endpoint) const { dds_builtintopic_free_endpoint(endpoint); }
};

}  // namespace

void EventHub::set(EventHandler handler) {
  const std::lock_guard lock(mutex_);
  handler_ = std::move(handler);
}

void EventHub::emit(const Event& event) {
  const std::lock_guard lock(mutex_);
  if (handler_) handler_(event);
}

std::unique_ptr<dds_listener_t, EndpointWatch::ListenerDeleter> EndpointWatch::make_listener() {
  std::unique_ptr<dds_listener_t, ListenerDeleter> listener(dds_create_listener(this));
  if (is_writer_) {
    dds_lset_publication_matched(listener.get(),
                                 [](dds_entity_t writer, const dds_publication_matched_status_t status, void* watch) {
                                   static_cast<EndpointWatch*>(watch)->on_match(writer, status.last_subscription_handle,
                                                                                status.current_count_change);
                                 });
    dds_lset_offered_incompatible_qos(
        listener.get(), [](dds_entity_t writer, const dds_offered_incompatible_qos_status_t status, void* watch) {
          static_cast<EndpointWatch*>(watch)->mismatch(writer, status.last_policy_id);
        });
    dds_lset_offered_deadline_missed(listener.get(),
                                     [](dds_entity_t writer, const dds_offered_deadline_missed_status_t, void* watch) {
                                       static_cast<EndpointWatch*>(watch)->deadline_missed(gid_of(writer));
                                     });
    dds_lset_liveliness_lost(listener.get(), [](dds_entity_t writer, const dds_liveliness_lost_status_t, void* watch) {
      static_cast<EndpointWatch*>(watch)->liveliness_lost(writer, 0);
    });
  } else {
    dds_lset_subscription_matched(listener.get(), [](dds_entity_t reader,
                                                     const dds_subscription_matched_status_t status, void* watch) {
      static_cast<EndpointWatch*>(watch)->on_match(reader, status.last_publication_handle, status.current_count_change);
    });
    dds_lset_requested_incompatible_qos(
        listener.get(), [](dds_entity_t reader, const dds_requested_incompatible_qos_status_t status, void* watch) {
          static_cast<EndpointWatch*>(watch)->mismatch(reader, status.last_policy_id);
        });
    dds_lset_liveliness_changed(
        listener.get(), [](dds_entity_t reader, const dds_liveliness_changed_status_t status, void* watch) {
          if (status.not_alive_count_change <= 0) return;
          static_cast<EndpointWatch*>(watch)->liveliness_lost(reader, status.last_publication_handle);
        });
  }
  return listener;
}

Event EndpointWatch::event(Event::Kind kind, const Gid& local, const Gid& remote) const {
  Event event;
  event.kind = kind;
  event.topic = config_.topic;
  event.is_writer = is_writer_;
  event.local = local;
  event.remote = remote;
  return event;
}

void EndpointWatch::emit(Event event) {
  event.text = std::string(is_writer_ ? "writer" : "reader") + " of " + config_.topic + ": " + event.text;
  state_.events.emit(event);
}

Gid EndpointWatch::remote_gid(dds_entity_t entity, dds_instance_handle_t handle) const {
  const std::unique_ptr<dds_builtintopic_endpoint_t, EndpointDeleter> endpoint(
      is_writer_ ? dds_get_matched_subscription_data(entity, handle)
                 : dds_get_matched_publication_data(entity, handle));
  return endpoint ? to_gid(endpoint->key) : Gid();
}

// With the other side known before, Cyclone calls while it creates the entity, and cannot yet tell who that is.
void EndpointWatch::on_match(dds_entity_t entity, dds_instance_handle_t handle, int change) {
  const std::lock_guard lock(match_mutex_);
  if (created_) return match(entity, handle, change);
  early_matches_.emplace_back(handle, change);
}

void EndpointWatch::created(dds_entity_t entity) {
  const std::lock_guard lock(match_mutex_);
  created_ = true;
  for (const auto& [handle, change] : early_matches_) match(entity, handle, change);
  early_matches_ = {};
}

void EndpointWatch::match(dds_entity_t entity, dds_instance_handle_t handle, int change) {
  const Gid local = gid_of(entity);
  Gid remote;
  if (change > 0) {
    remote = remote_gid(entity, handle);
    {
      const std::lock_guard lock(mutex_);
      peers_[handle] = remote;
    }
    ++matched_;
    if (!remote.same_participant(local)) ++remote_;
  } else {
    {
      const std::lock_guard lock(mutex_);
      const auto known = peers_.find(handle);
      if (known == peers_.end()) return;
      remote = known->second;
      peers_.erase(known);
    }
    --matched_;
    if (!remote.same_participant(local)) --remote_;
  }
  Event happened = event(change > 0 ? Event::Kind::matched : Event::Kind::unmatched, local, remote);
  happened.text = std::string(change > 0 ? "matched " : "lost its match ") + to_string(remote);
  emit(std::move(happened));
}

// Cyclone tells that there was a mismatch and one policy of it; the other side's announced QoS tells the rest.
void EndpointWatch::mismatch(dds_entity_t entity, std::uint32_t policy_id) {
  const Gid local = gid_of(entity);
  bool explained = false;
  for (const EndpointInfo& other : state_.discovery.endpoints(!is_writer_, config_.topic)) {
    if (other.dds_type != config_.type->dds_name) continue;
    std::vector<Mismatch> failing = is_writer_ ? check(config_.qos, other.qos) : check(other.qos, config_.qos);
    if (failing.empty()) continue;
    explained = true;
    {
      const std::lock_guard lock(mutex_);
      if (!reported_.insert(other.gid).second) continue;
    }
    Event happened = event(Event::Kind::qos_mismatch, local, other.gid);
    happened.text = "does not match the " + std::string(is_writer_ ? "reader " : "writer ") + to_string(other.gid);
    for (const Mismatch& policy : failing) {
      happened.text += "; " + policy.policy + ": offered " + policy.offered + ", requested " + policy.requested + " (" +
                       policy.remedy + ")";
    }
    happened.mismatches = std::move(failing);
    emit(std::move(happened));
  }
  if (explained) return;
  Event happened = event(Event::Kind::qos_mismatch, local, Gid());
  happened.mismatches = {{policy_name(policy_id), "unknown", "unknown", "give both sides the same value"}};
  happened.text = "does not match an endpoint because of its QoS policy " + policy_name(policy_id) +
                  ": give both sides the same value";
  emit(std::move(happened));
}

void EndpointWatch::liveliness_lost(dds_entity_t entity, dds_instance_handle_t handle) {
  Event happened = event(Event::Kind::liveliness_lost, gid_of(entity), Gid());
  if (!is_writer_) {
    const std::lock_guard lock(mutex_);
    const auto known = peers_.find(handle);
    if (known != peers_.end()) happened.remote = known->second;
  }
  happened.text = is_writer_ ? "did not show that it is alive within its lease"
                             : "writer " + to_string(happened.remote) + " did not show that it is alive in its lease";
  emit(std::move(happened));
}

void EndpointWatch::deadline_missed(const Gid& local) {
  Event happened = event(Event::Kind::deadline_missed, local, Gid());
  happened.text = is_writer_ ? "sent no sample within the deadline it offers" : "got no sample within its deadline";
  emit(std::move(happened));
}

void EndpointWatch::lost(const Gid& local, const Gid& writer, std::uint64_t count) {
  Event happened = event(Event::Kind::samples_lost, local, writer);
  happened.count = count;
  happened.text = "lost " + std::to_string(count) + " samples of writer " + to_string(writer);
  emit(std::move(happened));
}

}  // namespace adit::cyclonedds
