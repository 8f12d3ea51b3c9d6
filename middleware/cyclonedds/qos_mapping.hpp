// Qos to Cyclone's QoS object and back, announced exactly as ROS 2's rmw_cyclonedds announces it.
#pragma once

#include <dds/dds.h>

#include <memory>
#include <string>

#include "middleware/config.hpp"

namespace adit::cyclonedds {

struct QosDeleter {
  void operator()(dds_qos_t* qos) const { dds_delete_qos(qos); }
};
using QosPointer = std::unique_ptr<dds_qos_t, QosDeleter>;

QosPointer writer_qos(const EndpointConfig& config);
QosPointer reader_qos(const EndpointConfig& config);

// What a discovered endpoint announced. `history_known` tells whether it announced its history.
Qos from_dds(const dds_qos_t* qos, bool& history_known);
std::string user_data(const dds_qos_t* qos);
// The value of "key=value;" in a USER_DATA text, else empty.
std::string user_data_value(const std::string& user_data, const std::string& key);

// "Partition", "Ownership", ...: for mismatches outside of adit::Qos.
std::string policy_name(std::uint32_t policy_id);

}  // namespace adit::cyclonedds
