#include "middleware/fastdds/discovery.hpp"

#include <cstdio>

namespace adit::fastdds {
namespace {

std::string describe(const EndpointInfo& endpoint) {
  return std::string(endpoint.is_writer ? "writer " : "reader ") + to_string(endpoint.gid) + " (" +
         vendor_name(endpoint.gid) + "; " + to_string(endpoint.qos) + ")";
}

Event mismatch(const EndpointInfo& ours, const EndpointInfo& other, std::vector<Mismatch> failing) {
  Event event;
  event.kind = Event::Kind::qos_mismatch;
  event.topic = ours.topic;
  event.is_writer = ours.is_writer;
  event.local = ours.gid;
  event.remote = other.gid;
  event.text = ours.dds_topic + ": no data will pass between our " + describe(ours) + " and " + describe(other) + ".";
  for (const auto& policy : failing) {
    event.text += "\n  " + policy.policy + ": offered " + policy.offered + ", requested " + policy.requested +
                  "; remedy: " + policy.remedy;
  }
  event.mismatches = std::move(failing);
  return event;
}

}  // namespace

bool is_fast_dds(const Gid& gid) {
  return gid.bytes[0] == 0x01 && gid.bytes[1] == 0x0f;
}

std::string vendor_name(const Gid& gid) {
  if (is_fast_dds(gid)) return "Fast DDS";
  if (gid.bytes[0] == 0x01 && gid.bytes[1] == 0x10) return "Cyclone DDS";
  char text[24];
  std::snprintf(text, sizeof text, "vendor %02x.%02x", gid.bytes[0], gid.bytes[1]);
  return text;
}

std::string value_of(std::string_view key, std::string_view user_data) {
  while (!user_data.empty()) {
    const auto end = user_data.find(';');
    const auto field = user_data.substr(0, end);
    const auto equals = field.find('=');
    if (equals != field.npos && field.substr(0, equals) == key) return std::string(field.substr(equals + 1));
    if (end == user_data.npos) break;
    user_data.remove_prefix(end + 1);
  }
  return {};
}

void Discovery::add(const ParticipantInfo& participant) {
  const std::lock_guard lock(mutex_);
  participants_[participant.gid] = participant;
}

void Discovery::remove_participant(const Gid& gid) {
  const std::lock_guard lock(mutex_);
  participants_.erase(gid);
  std::erase_if(endpoints_, [&](const auto& known) { return known.first.same_participant(gid); });
  std::erase_if(reported_, [&](const auto& pair) { return pair.second.same_participant(gid); });
}

std::vector<Event> Discovery::add(const EndpointInfo& endpoint, bool ours) {
  std::vector<Event> events;
  const std::lock_guard lock(mutex_);
  endpoints_[endpoint.gid] = {endpoint, ours};

  const auto report = [&](const EndpointInfo& local, const EndpointInfo& other) {
    const auto& writer = local.is_writer ? local : other;
    const auto& reader = local.is_writer ? other : local;
    auto failing = check(writer.qos, reader.qos);
    if (writer.dds_type != reader.dds_type) {
      failing.push_back({"type", writer.dds_type, reader.dds_type, "use one type for a topic, or rename one of them"});
    }
    if (failing.empty()) {
      reported_.erase({local.gid, other.gid});
    } else if (reported_.insert({local.gid, other.gid}).second) {
      events.push_back(mismatch(local, other, std::move(failing)));
    }
  };
  for (const auto& [gid, known] : endpoints_) {
    if (known.info.is_writer == endpoint.is_writer || known.info.dds_topic != endpoint.dds_topic) continue;
    if (ours) report(endpoint, known.info);
    if (known.ours) report(known.info, endpoint);
  }
  return events;
}

void Discovery::remove_endpoint(const Gid& gid) {
  const std::lock_guard lock(mutex_);
  endpoints_.erase(gid);
  std::erase_if(reported_, [&](const auto& pair) { return pair.first == gid || pair.second == gid; });
}

Graph Discovery::graph() const {
  Graph graph;
  const std::lock_guard lock(mutex_);
  for (const auto& [gid, participant] : participants_) graph.participants.push_back(participant);
  for (const auto& [gid, known] : endpoints_) graph.endpoints.push_back(known.info);
  return graph;
}

}  // namespace adit::fastdds
