// Our values in the vendor's terms, and back: GUIDs, times, QoS.
#pragma once

#include <fastdds/dds/core/policy/QosPolicies.hpp>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/publisher/qos/WriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>
#include <fastdds/dds/subscriber/qos/ReaderQos.hpp>

#include "middleware/config.hpp"
#include "middleware/sample.hpp"

namespace adit::fastdds {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

Gid to_gid(const rtps::GUID_t& guid);
Gid to_gid(const rtps::InstanceHandle_t& handle);
Time to_time(const rtps::Time_t& time);
eprosima::fastrtps::Duration_t to_vendor(std::optional<Duration> duration);  // none: infinite
std::vector<rtps::octet> to_octets(std::string_view text);
std::string to_text(const std::vector<rtps::octet>& octets);

// How many samples of a reader may be held by the application at once, besides the `depth` waiting to be taken.
std::size_t outstanding_limit(const Qos& qos);
// Samples kept for a KEEP_ALL endpoint before it blocks its writers: bounded by memory for large types.
std::size_t keep_all_limit(const TypeInfo& type);

// How long after a sample a reliable writer asks its readers what they miss.
std::uint32_t heartbeat_period_ms(const Qos& qos);

// `synchronous`: publish() sends in the caller's thread.
dds::DataWriterQos writer_qos(const EndpointConfig& config, bool synchronous);
dds::DataReaderQos reader_qos(const EndpointConfig& config);

// What a remote endpoint announced. Fast DDS 2.9 does not hand on its history depth.
Qos announced(const dds::WriterQos& qos);
Qos announced(const dds::ReaderQos& qos);

}  // namespace adit::fastdds
