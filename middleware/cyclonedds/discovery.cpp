#include "middleware/cyclonedds/discovery.hpp"

#include <cstdio>
#include <cstring>

#include "middleware/cyclonedds/qos_mapping.hpp"

namespace adit::cyclonedds {
namespace {

// Calls `visit` for every sample that a built-in reader holds of an entity that is still there.
template <class Visit>
void for_each_alive(dds_entity_t reader, Visit visit) {
  constexpr std::size_t batch = 128;
  std::size_t room = batch;
  for (;;) {  // a read repeats everything, so the buffer must hold it all
    std::vector<void*> samples(room, nullptr);
    std::vector<dds_sample_info_t> infos(room);
    const dds_return_t count =
        dds_read_mask(reader, samples.data(), infos.data(), room, static_cast<std::uint32_t>(room),
                      DDS_ANY_SAMPLE_STATE | DDS_ANY_VIEW_STATE | DDS_ALIVE_INSTANCE_STATE);
    if (count <= 0) return;
    const bool complete = static_cast<std::size_t>(count) < room;
    if (complete) {
      for (dds_return_t i = 0; i < count; ++i) {
        if (infos[static_cast<std::size_t>(i)].valid_data) visit(samples[static_cast<std::size_t>(i)]);
      }
    }
    dds_return_loan(reader, samples.data(), count);
    if (complete) return;
    room *= 2;
  }
}

bool is_cyclone(const Gid& gid) {
  return gid.bytes[0] == 0x01 && gid.bytes[1] == 0x10;
}

std::string vendor_name(const Gid& gid) {
  if (gid.bytes[0] == 0x01 && gid.bytes[1] == 0x0f) return "Fast DDS";
  if (is_cyclone(gid)) return "Cyclone DDS";
  char text[24];
  std::snprintf(text, sizeof text, "vendor %02x.%02x", gid.bytes[0], gid.bytes[1]);
  return text;
}

EndpointInfo describe(const dds_builtintopic_endpoint_t& endpoint, bool is_writer) {
  EndpointInfo info;
  info.gid = to_gid(endpoint.key);
  info.is_writer = is_writer;
  info.dds_topic = info.topic = endpoint.topic_name;
  info.dds_type = info.type = endpoint.type_name;
  info.qos = from_dds(endpoint.qos, info.history_known);
  // Cyclone announces its history and leaves out the default; others that show the default announced nothing.
  if (info.history_known && !is_cyclone(info.gid) && info.qos.depth == 1) {
    info.history_known = false;
    info.qos.depth = 0;
  }
  info.type_hash = user_data_value(user_data(endpoint.qos), "typehash");
  return info;
}

}  // namespace

Gid to_gid(const dds_guid_t& guid) {
  Gid gid;
  std::memcpy(gid.bytes.data(), guid.v, sizeof guid.v);
  return gid;
}

Result<void> Discovery::start(dds_entity_t participant) {
  dds_guid_t guid;
  dds_get_guid(participant, &guid);
  self_ = to_gid(guid);
  participants_ = dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, nullptr, nullptr);
  writers_ = dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr);
  readers_ = dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION, nullptr, nullptr);
  for (const dds_entity_t reader : {participants_, writers_, readers_}) {
    if (reader < 0) return Error{ErrorCode::internal, std::string("built-in topic reader: ") + dds_strretcode(reader)};
  }
  return {};
}

Graph Discovery::graph() const {
  Graph graph;
  for_each_alive(participants_, [&](const void* sample) {
    const auto& participant = *static_cast<const dds_builtintopic_participant_t*>(sample);
    ParticipantInfo info;
    info.gid = to_gid(participant.key);
    info.local = info.gid == self_;
    info.vendor = vendor_name(info.gid);
    info.enclave = user_data_value(user_data(participant.qos), "enclave");
    char* name = nullptr;
    if (dds_qget_entity_name(participant.qos, &name) && name) {
      info.name = name;
      dds_free(name);
    }
    graph.participants.push_back(std::move(info));
  });
  for (const bool writers : {true, false}) {
    for_each_alive(writers ? writers_ : readers_, [&](const void* sample) {
      graph.endpoints.push_back(describe(*static_cast<const dds_builtintopic_endpoint_t*>(sample), writers));
    });
  }
  return graph;
}

std::vector<EndpointInfo> Discovery::endpoints(bool writers, const std::string& dds_topic) const {
  std::vector<EndpointInfo> found;
  for_each_alive(writers ? writers_ : readers_, [&](const void* sample) {
    const auto& endpoint = *static_cast<const dds_builtintopic_endpoint_t*>(sample);
    if (endpoint.topic_name == dds_topic) found.push_back(describe(endpoint, writers));
  });
  return found;
}

}  // namespace adit::cyclonedds
