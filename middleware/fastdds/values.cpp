#include "middleware/fastdds/values.hpp"

#include <algorithm>
#include <cstring>

namespace adit::fastdds {
namespace {

eprosima::fastrtps::Duration_t milliseconds(std::uint32_t count) {
  return {static_cast<std::int32_t>(count / 1000), count % 1000 * 1000000};
}

std::optional<Duration> from_vendor(const eprosima::fastrtps::Duration_t& duration) {
  if (duration.is_infinite()) return std::nullopt;
  return Duration(std::chrono::seconds(duration.seconds)) + Duration(duration.nanosec);
}

// The policies both kinds of endpoint announce under the same names.
template <class VendorQos>
void set_common(const EndpointConfig& config, VendorQos& to) {
  const Qos& qos = config.qos;
  to.reliability().kind =
      qos.reliability == Qos::Reliability::reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
  to.durability().kind = qos.durability == Qos::Durability::transient_local ? dds::TRANSIENT_LOCAL_DURABILITY_QOS
                                                                            : dds::VOLATILE_DURABILITY_QOS;
  to.deadline().period = to_vendor(qos.deadline);
  to.lifespan().duration = to_vendor(qos.lifespan);
  to.liveliness().kind = qos.liveliness == Qos::Liveliness::manual_by_topic ? dds::MANUAL_BY_TOPIC_LIVELINESS_QOS
                                                                            : dds::AUTOMATIC_LIVELINESS_QOS;
  to.liveliness().lease_duration = to_vendor(qos.lease);
  // Announce our liveliness often enough that one lost announcement does not end it.
  if (qos.lease) to.liveliness().announcement_period = to_vendor(*qos.lease * 2 / 5);
  to.user_data().setValue(to_octets(config.user_data));
  to.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  to.data_sharing().off();  // loses reliable samples when the writer is faster than the reader
}

void set_history(dds::HistoryQosPolicy& history, dds::ResourceLimitsQosPolicy& limits, bool keep_all,
                 std::size_t samples) {
  const auto count = static_cast<std::int32_t>(samples);
  history.kind = keep_all ? dds::KEEP_ALL_HISTORY_QOS : dds::KEEP_LAST_HISTORY_QOS;
  history.depth = keep_all ? 1 : count;
  limits.max_instances = 1;
  limits.max_samples = count;
  limits.max_samples_per_instance = count;
  limits.allocated_samples = std::min(count, 2);
}

template <class VendorQos>
Qos announced_common(const VendorQos& from) {
  Qos qos;
  qos.reliability = from.m_reliability.kind == dds::RELIABLE_RELIABILITY_QOS ? Qos::Reliability::reliable
                                                                             : Qos::Reliability::best_effort;
  qos.durability = from.m_durability.kind == dds::VOLATILE_DURABILITY_QOS ? Qos::Durability::volatile_
                                                                          : Qos::Durability::transient_local;
  qos.depth = 0;
  qos.deadline = from_vendor(from.m_deadline.period);
  qos.lifespan = from_vendor(from.m_lifespan.duration);
  qos.lease = from_vendor(from.m_liveliness.lease_duration);
  qos.liveliness = from.m_liveliness.kind == dds::MANUAL_BY_TOPIC_LIVELINESS_QOS ? Qos::Liveliness::manual_by_topic
                                                                                 : Qos::Liveliness::automatic;
  return qos;
}

}  // namespace

Gid to_gid(const rtps::GUID_t& guid) {
  Gid gid;
  std::memcpy(gid.bytes.data(), guid.guidPrefix.value, 12);
  std::memcpy(gid.bytes.data() + 12, guid.entityId.value, 4);
  return gid;
}

Gid to_gid(const rtps::InstanceHandle_t& handle) {
  rtps::GUID_t guid;
  rtps::iHandle2GUID(guid, handle);
  return to_gid(guid);
}

Time to_time(const rtps::Time_t& time) {
  return Time(Duration(time.to_ns()));
}

eprosima::fastrtps::Duration_t to_vendor(std::optional<Duration> duration) {
  if (!duration) return eprosima::fastrtps::c_TimeInfinite;
  const auto seconds = std::chrono::floor<std::chrono::seconds>(*duration);
  if (seconds.count() >= eprosima::fastrtps::c_TimeInfinite.seconds) return eprosima::fastrtps::c_TimeInfinite;
  return {static_cast<std::int32_t>(seconds.count()), static_cast<std::uint32_t>((*duration - seconds).count())};
}

std::vector<rtps::octet> to_octets(std::string_view text) {
  return {text.begin(), text.end()};
}

std::string to_text(const std::vector<rtps::octet>& octets) {
  return {octets.begin(), octets.end()};
}

std::size_t outstanding_limit(const Qos& qos) {
  return 64 + qos.depth;
}

std::size_t keep_all_limit(const TypeInfo& type) {
  constexpr std::size_t memory = 256 << 20, fewest = 32, most = 4096;
  return std::clamp(memory / std::max<std::size_t>(type.typical_size, 1), fewest, most);
}

// The default period of 3 s is how long a reader stalls after the last sample of a burst was lost. A heartbeat and its
// answer cost two processes about 100 us, as often as this; a keep-all writer cannot go on without them once it is
// full. None is sent along with data: a volatile Cyclone DDS reader takes the first heartbeat it sees as the end of
// what is not for it, which in the middle of a fragmented sample would cost it that sample. Therefore also no multiple
// of a usual sensor's period (10, 20, 33, 40, 50, 67, 100 ms).
std::uint32_t heartbeat_period_ms(const Qos& qos) {
  return qos.depth == 0 ? 20 : 75;
}

dds::DataWriterQos writer_qos(const EndpointConfig& config, bool synchronous) {
  dds::DataWriterQos qos;
  set_common(config, qos);
  const bool keep_all = config.qos.depth == 0;
  set_history(qos.history(), qos.resource_limits(), keep_all,
              keep_all ? keep_all_limit(*config.type) : config.qos.depth);
  qos.reliability().max_blocking_time = to_vendor(config.qos.max_blocking);
  qos.publish_mode().kind = synchronous ? dds::SYNCHRONOUS_PUBLISH_MODE : dds::ASYNCHRONOUS_PUBLISH_MODE;
  qos.reliable_writer_qos().times.heartbeatPeriod = milliseconds(heartbeat_period_ms(config.qos));
  qos.reliable_writer_qos().disable_heartbeat_piggyback = true;
  // What a reader asks for again goes out at once: within the vendor's 5 ms a fast writer overwrites it.
  qos.reliable_writer_qos().times.nackResponseDelay = milliseconds(0);
  return qos;
}

dds::DataReaderQos reader_qos(const EndpointConfig& config) {
  dds::DataReaderQos qos;
  set_common(config, qos);
  // The samples waiting in our queue and those the application holds are loans: they count in the vendor's limits.
  const bool keep_all = config.qos.depth == 0;
  const std::size_t waiting = keep_all ? keep_all_limit(*config.type) : config.qos.depth;
  const std::size_t samples = waiting + outstanding_limit(config.qos) + 8;
  set_history(qos.history(), qos.resource_limits(), keep_all, samples);
  auto& limits = qos.reader_resource_limits();
  limits.max_samples_per_read = 1;
  const std::size_t usual = std::min<std::size_t>(waiting + 6, 32);  // at once, without growing on the data path
  limits.outstanding_reads_allocation = {usual, samples, 4};
  limits.sample_infos_allocation = {usual, samples, 4};
  qos.reliable_reader_qos().times.initialAcknackDelay = milliseconds(5);
  return qos;
}

Qos announced(const dds::WriterQos& qos) {
  return announced_common(qos);
}

Qos announced(const dds::ReaderQos& qos) {
  return announced_common(qos);
}

}  // namespace adit::fastdds
