#include "bringup/commands/topic_monitor.hpp"

#include "bringup/commands/graph_table.hpp"
#include "bringup/commands/interrupt.hpp"

namespace adit {

Qos matching_qos(const std::vector<EndpointInfo>& writers) {
  Qos qos = Qos::sensor();
  qos.depth = 100;
  bool all_reliable = !writers.empty();
  bool all_latched = !writers.empty();
  for (const EndpointInfo& writer : writers) {
    all_reliable &= writer.qos.reliability == Qos::Reliability::reliable;
    all_latched &= writer.qos.durability == Qos::Durability::transient_local;
  }
  if (all_reliable) qos.reliability = Qos::Reliability::reliable;
  if (all_latched) qos.durability = Qos::Durability::transient_local;
  return qos;
}

bool begins_with_stamp(const TypeInfo& type) {
  std::string_view schema = type.schema;
  while (!schema.empty()) {
    const std::string_view line = schema.substr(0, schema.find('\n'));
    schema.remove_prefix(std::min(schema.size(), line.size() + 1));
    // Constants and comments may come first; the first field decides.
    if (line.empty() || line.starts_with('#') || line.find('=') != std::string_view::npos) continue;
    return line.starts_with("std_msgs/Header ") || line.starts_with("builtin_interfaces/Time ");
  }
  return false;
}

std::optional<Time> leading_stamp(Bytes cdr) {
  if (cdr.size() < 12) return std::nullopt;
  const bool little = cdr[1] == std::byte{1};
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i)
      value |= std::to_integer<std::uint32_t>(cdr[at + i]) << 8 * (little ? i : 3 - i);
    return value;
  };
  const auto seconds = static_cast<std::int32_t>(word(4));
  const std::uint32_t nanoseconds = word(8);
  if (nanoseconds >= 1'000'000'000) return std::nullopt;
  return Time(std::chrono::seconds(seconds) + std::chrono::nanoseconds(nanoseconds));
}

Result<std::unique_ptr<TopicMonitor>> TopicMonitor::open(const ParticipantConfig& config, const std::string& topic,
                                                         Duration discovery) {
  Result<std::unique_ptr<Participant>> participant = adit::open(config);
  if (!participant) return participant.error();
  std::unique_ptr<TopicMonitor> monitor(new TopicMonitor);
  monitor->participant_ = *std::move(participant);

  std::vector<EndpointInfo> writers;
  const auto end = std::chrono::steady_clock::now() + discovery;
  Graph graph;
  do {
    graph = settled_graph(*monitor->participant_, std::chrono::milliseconds(400));
    for (const EndpointInfo& endpoint : graph.endpoints) {
      if (endpoint.topic == topic && endpoint.is_writer) writers.push_back(endpoint);
    }
  } while (writers.empty() && std::chrono::steady_clock::now() < end);
  if (writers.empty()) {
    const std::string found = topic_list(graph, false);
    return Error{
        ErrorCode::not_found,
        "nobody writes '" + topic + "' in domain " + std::to_string(config.domain) + " (network " + config.network +
            "); " +
            (found.empty() ? "no topics at all: is the domain right, and does the other side run on this network?"
                           : "topics there:\n" + found)};
  }
  for (const EndpointInfo& writer : writers) {
    if (writer.dds_type != writers.front().dds_type) {
      return Error{ErrorCode::incompatible, "'" + topic + "' is written with two types: " + writers.front().type +
                                                " and " + writer.type + "; see adit topic info " + topic};
    }
  }
  monitor->type_ = writers.front().type;
  monitor->dds_type_ = writers.front().dds_type;
  monitor->hash_ = writers.front().type_hash;
  monitor->info_ = {monitor->type_, monitor->dds_type_, monitor->hash_, "", 1024};
  EndpointConfig endpoint;
  endpoint.topic = topic;
  endpoint.type = &monitor->info_;
  endpoint.qos = matching_qos(writers);
  endpoint.node = "/adit_topic";
  Result<std::unique_ptr<Reader>> reader = monitor->participant_->reader(endpoint);
  if (!reader) return reader.error();
  monitor->reader_ = *std::move(reader);
  return monitor;
}

void TopicMonitor::run(std::optional<Duration> limit, const std::function<bool(const Sample&)>& handle) {
  const Interrupt interrupt;
  reader_->on_data([this] {
    const std::lock_guard lock(mutex_);
    ready_ = true;
    wake_.notify_one();
  });
  const auto end = std::chrono::steady_clock::now() + limit.value_or(std::chrono::hours(24 * 365));
  bool wanted = true;
  while (wanted && !interrupt.requested() && std::chrono::steady_clock::now() < end) {
    {
      std::unique_lock lock(mutex_);
      // Short waits, because a signal does not wake a condition variable.
      wake_.wait_until(lock, std::min(end, std::chrono::steady_clock::now() + std::chrono::milliseconds(100)),
                       [this] { return ready_; });
      ready_ = false;
    }
    Sample sample;
    while (wanted && reader_->take({&sample, 1}) == 1) wanted = handle(sample);
  }
  reader_->on_data(nullptr);
}

}  // namespace adit
