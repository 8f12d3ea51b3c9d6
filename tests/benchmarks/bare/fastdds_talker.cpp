// std_msgs/String on /chatter, on Fast DDS alone: adit_bench_fastdds_talker SECONDS DOMAIN HERTZ. Loopback only; the
// shared-memory segment is ours, so that memory is compared like with like.
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <string>
#include <thread>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>

#include "tests/benchmarks/bare/fastdds_type.hpp"

namespace {

volatile std::sig_atomic_t stop = 0;

}  // namespace

int main(int argc, char** argv) {
  namespace dds = eprosima::fastdds::dds;
  namespace transport = eprosima::fastdds::rtps;
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { stop = 1; });
  const double seconds = argc > 1 ? std::atof(argv[1]) : 10.0;
  const auto domain = static_cast<std::uint32_t>(argc > 2 ? std::atoi(argv[2]) : 0);
  const double hertz = argc > 3 ? std::atof(argv[3]) : 10.0;
  dds::DomainParticipantQos participant_qos;
  auto udp = std::make_shared<transport::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = {"127.0.0.1"};
  auto memory = std::make_shared<transport::SharedMemTransportDescriptor>();
  memory->segment_size(8u << 20);
  participant_qos.transport().use_builtin_transports = false;
  participant_qos.transport().user_transports = {memory, udp};
  auto& builtin = participant_qos.wire_protocol().builtin;
  builtin.discovery_config.initial_announcements = {5, {0, 10'000'000}};
  eprosima::fastrtps::rtps::Locator_t host;  // unicast, as ours
  host.kind = LOCATOR_KIND_UDPv4;
  eprosima::fastrtps::rtps::IPLocator::setIPv4(host, "127.0.0.1");
  builtin.initialPeersList.push_back(host);
  auto& factory = *dds::DomainParticipantFactory::get_instance();
  auto* const participant = factory.create_participant(domain, participant_qos);
  if (!participant) return 1;
  const std::string type = "std_msgs::msg::dds_::String_";
  dds::TypeSupport(new adit::bench::BytesType(type, 256)).register_type(participant);
  auto* const topic = participant->create_topic("rt/chatter", type, dds::TOPIC_QOS_DEFAULT);
  auto qos = dds::DATAWRITER_QOS_DEFAULT;
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  qos.history().depth = 10;
  qos.data_sharing().off();
  auto* const writer = participant->create_publisher(dds::PUBLISHER_QOS_DEFAULT)->create_datawriter(topic, qos);
  if (!writer) return 1;
  for (int i = 0; i < static_cast<int>(hertz * seconds) && !stop; ++i) {
    const std::string text = "Hello World: " + std::to_string(i);
    adit::bench::BytesType::Bytes bytes(text.c_str(), text.c_str() + text.size() + 1);
    writer->write(&bytes);
    std::this_thread::sleep_for(std::chrono::duration<double>(1.0 / hertz));
  }
  participant->delete_contained_entities();
  factory.delete_participant(participant);
  return 0;
}
