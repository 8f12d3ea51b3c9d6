#include "middleware/cyclonedds/qos_mapping.hpp"

#include <limits>

namespace adit::cyclonedds {
namespace {

dds_duration_t to_dds(const std::optional<Duration>& duration) {
  return duration ? duration->count() : DDS_INFINITY;
}

std::optional<Duration> from_dds(dds_duration_t duration) {
  if (duration == DDS_INFINITY) return std::nullopt;
  return Duration(duration);
}

QosPointer common_qos(const EndpointConfig& config) {
  const Qos& qos = config.qos;
  QosPointer dds(dds_create_qos());
  const bool reliable = qos.reliability == Qos::Reliability::reliable;
  dds_qset_reliability(dds.get(), reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                       reliable ? qos.max_blocking.count() : 0);
  dds_qset_durability(dds.get(), qos.durability == Qos::Durability::transient_local ? DDS_DURABILITY_TRANSIENT_LOCAL
                                                                                    : DDS_DURABILITY_VOLATILE);
  constexpr std::uint32_t most = std::numeric_limits<std::int32_t>::max();
  const auto depth = static_cast<std::int32_t>(std::min(qos.depth, most));
  dds_qset_history(dds.get(), depth == 0 ? DDS_HISTORY_KEEP_ALL : DDS_HISTORY_KEEP_LAST, depth);
  dds_qset_deadline(dds.get(), to_dds(qos.deadline));
  dds_qset_liveliness(
      dds.get(),
      qos.liveliness == Qos::Liveliness::automatic ? DDS_LIVELINESS_AUTOMATIC : DDS_LIVELINESS_MANUAL_BY_TOPIC,
      to_dds(qos.lease));
  const dds_data_representation_id_t representation = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(dds.get(), 1, &representation);
  if (config.ignore_local) dds_qset_ignorelocal(dds.get(), DDS_IGNORELOCAL_PARTICIPANT);
  if (!config.user_data.empty()) dds_qset_userdata(dds.get(), config.user_data.data(), config.user_data.size());
  return dds;
}

}  // namespace

QosPointer writer_qos(const EndpointConfig& config) {
  QosPointer dds = common_qos(config);
  const Qos& qos = config.qos;
  dds_qset_writer_data_lifecycle(dds.get(), false);
  dds_qset_lifespan(dds.get(), to_dds(qos.lifespan));
  if (qos.durability == Qos::Durability::transient_local) {
    // What a late joiner gets is the durability service's history, not the writer's.
    const bool all = qos.depth == 0;
    dds_qset_durability_service(dds.get(), 0, all ? DDS_HISTORY_KEEP_ALL : DDS_HISTORY_KEEP_LAST,
                                all ? DDS_LENGTH_UNLIMITED : static_cast<std::int32_t>(qos.depth), DDS_LENGTH_UNLIMITED,
                                DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  }
  return dds;
}

QosPointer reader_qos(const EndpointConfig& config) {
  return common_qos(config);
}

Qos from_dds(const dds_qos_t* dds, bool& history_known) {
  Qos qos;
  dds_reliability_kind_t reliability = DDS_RELIABILITY_BEST_EFFORT;
  dds_duration_t max_blocking = 0;
  if (dds_qget_reliability(dds, &reliability, &max_blocking)) {
    qos.reliability =
        reliability == DDS_RELIABILITY_RELIABLE ? Qos::Reliability::reliable : Qos::Reliability::best_effort;
    qos.max_blocking = Duration(max_blocking);
  }
  dds_durability_kind_t durability = DDS_DURABILITY_VOLATILE;
  if (dds_qget_durability(dds, &durability) && durability != DDS_DURABILITY_VOLATILE) {
    qos.durability = Qos::Durability::transient_local;
  }
  dds_history_kind_t history = DDS_HISTORY_KEEP_LAST;
  std::int32_t depth = 0;
  history_known = dds_qget_history(dds, &history, &depth);
  qos.depth = history_known && history == DDS_HISTORY_KEEP_LAST ? static_cast<std::uint32_t>(depth) : 0;
  dds_duration_t duration = DDS_INFINITY;
  if (dds_qget_deadline(dds, &duration)) qos.deadline = from_dds(duration);
  if (dds_qget_lifespan(dds, &duration)) qos.lifespan = from_dds(duration);
  dds_liveliness_kind_t liveliness = DDS_LIVELINESS_AUTOMATIC;
  if (dds_qget_liveliness(dds, &liveliness, &duration)) {
    qos.liveliness =
        liveliness == DDS_LIVELINESS_AUTOMATIC ? Qos::Liveliness::automatic : Qos::Liveliness::manual_by_topic;
    qos.lease = from_dds(duration);
  }
  return qos;
}

std::string user_data(const dds_qos_t* qos) {
  void* data = nullptr;
  std::size_t size = 0;
  if (!dds_qget_userdata(qos, &data, &size) || !data) return {};
  std::string text(static_cast<const char*>(data), size);
  dds_free(data);
  return text;
}

std::string user_data_value(const std::string& user_data, const std::string& key) {
  for (std::size_t at = 0; at < user_data.size();) {
    const std::size_t end = std::min(user_data.find(';', at), user_data.size());
    if (user_data.compare(at, key.size() + 1, key + "=") == 0) {
      return user_data.substr(at + key.size() + 1, end - at - key.size() - 1);
    }
    at = end + 1;
  }
  return {};
}

std::string policy_name(std::uint32_t policy_id) {
  switch (policy_id) {
    case DDS_PRESENTATION_QOS_POLICY_ID:
      return "presentation";
    case DDS_LATENCYBUDGET_QOS_POLICY_ID:
      return "latency budget";
    case DDS_OWNERSHIP_QOS_POLICY_ID:
      return "ownership";
    case DDS_PARTITION_QOS_POLICY_ID:
      return "partition";
    case DDS_DESTINATIONORDER_QOS_POLICY_ID:
      return "destination order";
    case DDS_TYPE_CONSISTENCY_ENFORCEMENT_QOS_POLICY_ID:
      return "type consistency";
    case DDS_DATA_REPRESENTATION_QOS_POLICY_ID:
      return "data representation";
    default:
      return "policy " + std::to_string(policy_id);
  }
}

}  // namespace adit::cyclonedds
