#include "middleware/cyclonedds/participant.hpp"

#include <dds/version.h>

#include <sstream>

#include "middleware/cyclonedds/log.hpp"
#include "middleware/cyclonedds/qos_mapping.hpp"
#include "middleware/cyclonedds/raw_type.hpp"
#include "middleware/cyclonedds/security.hpp"

namespace adit::cyclonedds {

Error to_error(dds_return_t code, const std::string& doing) {
  const std::string text = doing + ": " + dds_strretcode(code);
  switch (code) {
    case DDS_RETCODE_TIMEOUT:
      return {ErrorCode::timeout, text};
    case DDS_RETCODE_BAD_PARAMETER:
      return {ErrorCode::invalid_argument, text};
    case DDS_RETCODE_OUT_OF_RESOURCES:
      return {ErrorCode::out_of_resources, text};
    case DDS_RETCODE_INCONSISTENT_POLICY:
      return {ErrorCode::invalid_argument, text};
    case DDS_RETCODE_PRECONDITION_NOT_MET:
      return {ErrorCode::incompatible, text};
    default:
      return {ErrorCode::internal, text};
  }
}

Gid gid_of(dds_entity_t entity) {
  dds_guid_t guid{};
  dds_get_guid(entity, &guid);
  return to_gid(guid);
}

Result<dds_entity_t> ParticipantState::open_topic(const EndpointConfig& endpoint, const ddsi_sertype*& type) {
  const std::string type_name(endpoint.type->dds_name);
  {
    const std::lock_guard lock(topics_mutex_);
    TopicUse& use = topics_[endpoint.topic];
    if (use.endpoints > 0 && use.type != type_name) {
      return Error{ErrorCode::incompatible, "topic " + endpoint.topic + " exists with type " + use.type + ", not " +
                                                type_name + ": use another topic name or that type"};
    }
    use.type = type_name;
    ++use.endpoints;
  }
  ddsi_sertype* sertype = make_raw_type(type_name.c_str());
  const dds_entity_t topic =
      dds_create_topic_sertype(participant, endpoint.topic.c_str(), &sertype, nullptr, nullptr, nullptr);
  if (topic < 0) {
    ddsi_sertype_unref(sertype);
    close_topic(endpoint.topic);
    return to_error(topic, "topic " + endpoint.topic);
  }
  type = sertype;
  return topic;
}

void ParticipantState::close_topic(const std::string& topic) {
  const std::lock_guard lock(topics_mutex_);
  const auto use = topics_.find(topic);
  if (use != topics_.end() && --use->second.endpoints == 0) topics_.erase(use);
}

namespace {

Result<void> check_endpoint(const EndpointConfig& config) {
  if (config.topic.empty()) return Error{ErrorCode::invalid_argument, "a topic needs a name"};
  if (!config.type || config.type->dds_name.empty()) {
    return Error{ErrorCode::invalid_argument, "topic " + config.topic + " needs a type"};
  }
  return validate(config.qos);
}

class CycloneParticipant final : public Participant {
 public:
  explicit CycloneParticipant(std::unique_ptr<ParticipantState> state) : state_(std::move(state)) {}
  ~CycloneParticipant() override {
    dds_delete(state_->participant);
    dds_delete(state_->domain);
  }

  Result<std::unique_ptr<Writer>> writer(const EndpointConfig& config) override {
    if (auto valid = check_endpoint(config); !valid) return valid.error();
    return make_writer(*state_, config);
  }
  Result<std::unique_ptr<Reader>> reader(const EndpointConfig& config) override {
    if (auto valid = check_endpoint(config); !valid) return valid.error();
    return make_reader(*state_, config);
  }
  Graph graph() const override { return state_->discovery.graph(); }
  void on_event(EventHandler handler) override { state_->events.set(std::move(handler)); }
  std::string explain() const override;
  const ParticipantConfig& config() const override { return state_->config; }
  Gid gid() const override { return state_->gid; }

 private:
  std::unique_ptr<ParticipantState> state_;
};

std::string CycloneParticipant::explain() const {
  const Configuration& c = state_->configuration;
  std::ostringstream text;
  text << "Cyclone DDS " << DDS_VERSION << ", domain " << state_->config.domain << ", participant "
       << to_string(state_->gid) << "\n"
       << "  network        " << c.interface << ", multicast " << (c.multicast ? "for discovery" : "off") << "\n"
       << "  peers          ";
  for (const std::string& peer : c.peers) text << peer << " ";
  text << "(participant index 0 to " << c.last_participant_index << " each)\n"
       << "  socket buffers receive " << c.receive_buffer << " bytes, send " << c.send_buffer << " bytes ("
       << state_->config.socket_buffer_bytes << " asked for)\n"
       << "  fragments      " << c.fragment_bytes << " bytes, one UDP datagram each\n"
       << "  shared memory  not used with Cyclone DDS\n"
       << "  security       "
       << (state_->config.security ? "DDS Security, enclave " + state_->config.security->enclave : std::string("off"))
       << "\n";
  for (const std::string& warning : c.warnings) text << "  warning        " << warning << "\n";
  text << "  configuration  " << c.xml << "\n";
  return text.str();
}

// Every participant is a Cyclone domain of its own in this process (its own sockets, threads, configuration), so that
// participants with different settings can be open side by side; ExternalDomainId is the one on the wire.
dds_domainid_t next_internal_domain() {
  static std::atomic<dds_domainid_t> next = 1000;
  return next++;
}

Error refusal(dds_return_t code, const ParticipantConfig& config, const Configuration& configuration,
              const std::string& log) {
  if (log.find("free participant index") != std::string::npos) {
    return {ErrorCode::out_of_resources, "no free participant index in domain " + std::to_string(config.domain) +
                                             " on " + configuration.interface + ": " +
                                             std::to_string(configuration.last_participant_index + 1) +
                                             " participants are there already; stop some or use another domain"};
  }
  Error error = to_error(
      code, "Cyclone DDS cannot join domain " + std::to_string(config.domain) + " on " + configuration.interface);
  if (!log.empty()) error.message += " (" + log + ")";
  return error;
}

}  // namespace

Result<std::unique_ptr<Participant>> open_participant(const ParticipantConfig& config, std::string_view user_data) {
  auto configuration = make_configuration(config);
  if (!configuration) return configuration.error();
  auto state = std::make_unique<ParticipantState>();
  state->config = config;
  state->configuration = std::move(*configuration);

  QosPointer qos(dds_create_qos());
  dds_qset_entity_name(qos.get(), config.name.c_str());
  if (!user_data.empty()) dds_qset_userdata(qos.get(), user_data.data(), user_data.size());
  if (config.security) {
    if (auto secured = secure(*config.security, qos.get()); !secured) return secured.error();
  }

  LogCapture log;
  const dds_domainid_t internal_domain = next_internal_domain();
  state->domain = dds_create_domain(internal_domain, state->configuration.xml.c_str());
  if (state->domain < 0) return refusal(state->domain, config, state->configuration, log.text());
  state->participant = dds_create_participant(internal_domain, qos.get(), nullptr);
  if (state->participant < 0) {
    const dds_return_t code = state->participant;
    dds_delete(state->domain);
    return refusal(code, config, state->configuration, log.text());
  }
  state->gid = gid_of(state->participant);
  if (auto started = state->discovery.start(state->participant); !started) {
    dds_delete(state->domain);
    return started.error();
  }
  return std::unique_ptr<Participant>(std::make_unique<CycloneParticipant>(std::move(state)));
}

}  // namespace adit::cyclonedds
