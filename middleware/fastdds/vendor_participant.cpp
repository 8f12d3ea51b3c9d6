#include "middleware/fastdds/vendor_participant.hpp"

#include <fastrtps/config.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>

#include <cstdlib>
#include <cstring>
#include <iostream>

#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/log/Log.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/publisher/qos/PublisherQos.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/subscriber/qos/SubscriberQos.hpp>
#include <fastdds/dds/topic/Topic.hpp>

#include "middleware/fastdds/serialized_type.hpp"

namespace adit::fastdds {
namespace {

// The vendor's errors go to stderr (its own choice is stdout, where programs put their results).
class StandardErrorLog final : public dds::LogConsumer {
  void Consume(const dds::Log::Entry& entry) override {
    const std::string line = std::string("fastdds: ") + entry.context.category + ": " + entry.message + "\n";
    std::cerr << line;
  }
};

// Once a process: no XML profile from the environment or the working directory decides anything here.
dds::DomainParticipantFactory& factory() {
  static dds::DomainParticipantFactory& instance = [&]() -> dds::DomainParticipantFactory& {
    dds::Log::ClearConsumers();
    dds::Log::RegisterConsumer(std::make_unique<StandardErrorLog>());
    auto& created = *dds::DomainParticipantFactory::get_instance();
    created.load_profiles();
    eprosima::fastrtps::LibrarySettingsAttributes settings;
    settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_FULL;
    eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
    return created;
  }();
  return instance;
}

template <class ProxyData, class VendorQos>
EndpointInfo endpoint_info(const ProxyData& data, const VendorQos& qos, bool is_writer) {
  EndpointInfo info;
  info.gid = to_gid(data.guid());
  info.is_writer = is_writer;
  info.dds_topic = info.topic = data.topicName().to_string();
  info.dds_type = info.type = data.typeName().to_string();
  info.type_hash = value_of("typehash", to_text(qos.m_userData.getValue()));
  info.qos = announced(qos);
  return info;
}

}  // namespace

Result<std::shared_ptr<VendorParticipant>> VendorParticipant::open(const ParticipantConfig& config,
                                                                   std::string_view user_data) {
  if (const char* server = std::getenv("ROS_DISCOVERY_SERVER"); server && *server) {
    return Error{ErrorCode::unavailable,
                 "ROS_DISCOVERY_SERVER is set, which would replace the configured discovery: unset it"};
  }
  auto configuration = configure(config, user_data);
  if (!configuration) return configuration.error();

  ParticipantInfo self;
  self.name = config.name;
  self.enclave = value_of("enclave", user_data);
  self.vendor = "Fast DDS";
  self.local = true;
  std::shared_ptr<VendorParticipant> result(new VendorParticipant(config, *std::move(configuration)));
  result->participant_ =
      factory().create_participant(config.domain, result->configuration_.qos, result.get(), dds::StatusMask::none());
  if (!result->participant_) {
    return Error{ErrorCode::unavailable, "Fast DDS cannot join domain " + std::to_string(config.domain) +
                                             ": no free participant id, a transport or security that does not start; "
                                             "its own message is on stderr. Configuration:\n" +
                                             result->configuration_.explanation};
  }
  *result->configuration_.audible = true;
  result->gid_ = self.gid = to_gid(result->participant_->guid());
  result->discovery_.add(self);

  // Endpoints are enabled once we know them, so that no callback comes earlier.
  dds::PublisherQos publisher_qos;
  publisher_qos.entity_factory().autoenable_created_entities = false;
  dds::SubscriberQos subscriber_qos;
  subscriber_qos.entity_factory().autoenable_created_entities = false;
  result->publisher_ = result->participant_->create_publisher(publisher_qos);
  result->subscriber_ = result->participant_->create_subscriber(subscriber_qos);
  if (!result->publisher_ || !result->subscriber_) {
    return Error{ErrorCode::internal, "Fast DDS refused a publisher or subscriber"};
  }
  return result;
}

VendorParticipant::VendorParticipant(const ParticipantConfig& config, Configuration configuration)
    : config_(config), configuration_(std::move(configuration)) {}

VendorParticipant::~VendorParticipant() {
  if (!participant_) return;
  participant_->set_listener(nullptr);
  participant_->delete_contained_entities();
  factory().delete_participant(participant_);
}

Result<dds::Topic*> VendorParticipant::acquire_topic(const std::string& name, const TypeInfo& type) {
  const std::lock_guard lock(topics_mutex_);
  const std::string type_name(type.dds_name);
  auto& shared = topics_[name];
  if (!shared.topic) {
    if (participant_->find_type(type_name).empty()) {
      dds::TypeSupport support(new SerializedType(type));
      support.register_type(participant_);
    }
    shared.topic = participant_->create_topic(name, type_name, dds::TOPIC_QOS_DEFAULT);
    if (!shared.topic) {
      topics_.erase(name);
      return Error{ErrorCode::invalid_argument, "Fast DDS refuses topic '" + name + "' of type '" + type_name + "'"};
    }
  } else if (shared.topic->get_type_name() != type_name) {
    return Error{ErrorCode::incompatible, "topic '" + name + "' exists with type '" + shared.topic->get_type_name() +
                                              "', not '" + type_name + "': use another name or the same type"};
  }
  ++shared.users;
  return shared.topic;
}

void VendorParticipant::release_topic(const std::string& name) {
  const std::lock_guard lock(topics_mutex_);
  const auto found = topics_.find(name);
  if (found == topics_.end() || --found->second.users > 0) return;
  participant_->delete_topic(found->second.topic);
  topics_.erase(found);
}

void VendorParticipant::add_endpoint(const EndpointConfig& config, const Gid& gid, bool is_writer) {
  EndpointInfo info;
  info.gid = gid;
  info.is_writer = is_writer;
  info.dds_topic = info.topic = config.topic;
  info.dds_type = info.type = config.type->dds_name;
  info.type_hash = value_of("typehash", config.user_data);
  info.node = config.node;
  info.qos = config.qos;
  info.history_known = true;
  post(discovery_.add(info, true));
}

std::string VendorParticipant::explain() const {
  return "Fast DDS " FASTRTPS_VERSION_STR ", domain " + std::to_string(config_.domain) + ", participant " +
         to_string(gid_) + "\n" + configuration_.explanation +
         "data-sharing: off; same process: by reference; writers: " +
         (configuration_.loopback ? "synchronous" : "synchronous, those of large messages asynchronous") +
         ", heartbeat 75 ms, keep-all writers 20 ms\n";
}

void VendorParticipant::on_participant_discovery(dds::DomainParticipant*, rtps::ParticipantDiscoveryInfo&& discovered) {
  using rtps::ParticipantDiscoveryInfo;
  const Gid gid = to_gid(discovered.info.m_guid);
  if (discovered.status == ParticipantDiscoveryInfo::REMOVED_PARTICIPANT ||
      discovered.status == ParticipantDiscoveryInfo::DROPPED_PARTICIPANT) {
    discovery_.remove_participant(gid);
    return;
  }
  ParticipantInfo info;
  info.gid = gid;
  info.name = discovered.info.m_participantName.to_string();
  info.enclave = value_of("enclave", to_text(discovered.info.m_userData.getValue()));
  info.vendor = vendor_name(gid);
  discovery_.add(info);
}

void VendorParticipant::on_publisher_discovery(dds::DomainParticipant*, rtps::WriterDiscoveryInfo&& discovered) {
  if (discovered.status == rtps::WriterDiscoveryInfo::REMOVED_WRITER) {
    discovery_.remove_endpoint(to_gid(discovered.info.guid()));
  } else {
    post(discovery_.add(endpoint_info(discovered.info, discovered.info.m_qos, true), false));
  }
}

void VendorParticipant::on_subscriber_discovery(dds::DomainParticipant*, rtps::ReaderDiscoveryInfo&& discovered) {
  if (discovered.status == rtps::ReaderDiscoveryInfo::REMOVED_READER) {
    const std::lock_guard lock(addresses_mutex_);
    addresses_.erase(to_gid(discovered.info.guid()));
    discovery_.remove_endpoint(to_gid(discovered.info.guid()));
  } else {
    remember_address(discovered.info);
    post(discovery_.add(endpoint_info(discovered.info, discovered.info.m_qos, false), false));
  }
}

void VendorParticipant::remember_address(const rtps::ReaderProxyData& reader) {
  const Gid gid = to_gid(reader.guid());
  if (is_fast_dds(gid) || reader.m_qos.m_reliability.kind != dds::RELIABLE_RELIABILITY_QOS) return;
  for (const rtps::Locator_t& locator : reader.remote_locators().unicast) {
    if (locator.kind != LOCATOR_KIND_UDPv4) continue;
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(locator.port));
    std::memcpy(&address.sin_addr, locator.address + 12, sizeof address.sin_addr);
    const std::lock_guard lock(addresses_mutex_);
    addresses_[gid] = address;
    return;
  }
}

void VendorParticipant::expect_first_heartbeat(const Gid& writer, const Gid& reader, std::uint64_t last) {
  if (!first_heartbeat() || is_fast_dds(reader)) return;
  const std::lock_guard lock(addresses_mutex_);
  const auto found = addresses_.find(reader);
  if (found != addresses_.end()) first_heartbeat()->expect(writer, reader, last, found->second);
}

void VendorParticipant::post(std::vector<Event> events) {
  for (auto& event : events) events_.post(std::move(event));
}

}  // namespace adit::fastdds
