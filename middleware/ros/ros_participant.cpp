#include "middleware/ros/ros_participant.hpp"

#include <algorithm>
#include <map>
#include <mutex>
#include <set>

#include "middleware/ros/discovery_info.hpp"
#include "middleware/ros/names.hpp"

namespace adit {
namespace {

constexpr const char* discovery_topic = "ros_discovery_info";

// Our own entry in the ROS graph: republished whole whenever an endpoint comes or goes, as every rmw does.
class NodeAnnouncer {
 public:
  NodeAnnouncer(std::unique_ptr<Writer> writer, const Gid& participant, GidForm form)
      : writer_(std::move(writer)), form_(form) {
    info_.participant = participant;
  }

  void add(const std::string& node, const Gid& endpoint, bool is_writer) {
    const std::lock_guard lock(mutex_);
    list(node, is_writer).push_back(endpoint);
    announce();
  }

  void remove(const std::string& node, const Gid& endpoint, bool is_writer) {
    const std::lock_guard lock(mutex_);
    std::erase(list(node, is_writer), endpoint);
    const NodeEndpoints& left = info_.nodes[node];
    if (left.readers.empty() && left.writers.empty()) info_.nodes.erase(node);
    announce();
  }

  DiscoveryInfo info() const {
    const std::lock_guard lock(mutex_);
    return info_;
  }

 private:
  std::vector<Gid>& list(const std::string& node, bool is_writer) {
    return is_writer ? info_.nodes[node].writers : info_.nodes[node].readers;
  }
  // Names are a courtesy to tools: when announcing fails, data still flows, and the next change announces again.
  void announce() { (void)writer_->forward(encode_discovery(info_, form_)); }

  std::unique_ptr<Writer> writer_;
  GidForm form_;
  mutable std::mutex mutex_;
  DiscoveryInfo info_;
};

// Keeps an endpoint's entry in the graph for as long as the endpoint lives. `announcer` outlives it, or is null.
class Announcement {
 public:
  Announcement(NodeAnnouncer* announcer, std::string node, const Gid& gid, bool is_writer)
      : announcer_(announcer), node_(std::move(node)), gid_(gid), is_writer_(is_writer) {
    if (announcer_) announcer_->add(node_, gid_, is_writer_);
  }
  Announcement(const Announcement&) = delete;
  Announcement& operator=(const Announcement&) = delete;
  ~Announcement() {
    if (announcer_) announcer_->remove(node_, gid_, is_writer_);
  }

 private:
  NodeAnnouncer* announcer_;
  std::string node_;
  Gid gid_;
  bool is_writer_;
};

class RosWriter final : public Writer {
 public:
  RosWriter(std::unique_ptr<Writer> inner, EndpointConfig config, NodeAnnouncer* announcer)
      : inner_(std::move(inner)), config_(std::move(config)), entry_(announcer, config_.node, inner_->gid(), true) {}

  Result<void> publish(const Encoder& message, Time time) override { return inner_->publish(message, time); }
  Result<void> forward(Bytes cdr, Time time) override { return inner_->forward(cdr, time); }
  bool has_remote_readers() const override { return inner_->has_remote_readers(); }
  Result<void> wait_for_acknowledgements(Duration timeout) override {
    return inner_->wait_for_acknowledgements(timeout);
  }
  LinkStats stats() const override { return inner_->stats(); }
  const EndpointConfig& config() const override { return config_; }
  Gid gid() const override { return inner_->gid(); }

 private:
  std::unique_ptr<Writer> inner_;
  EndpointConfig config_;
  Announcement entry_;
};

class RosReader final : public Reader {
 public:
  RosReader(std::unique_ptr<Reader> inner, EndpointConfig config, NodeAnnouncer* announcer)
      : inner_(std::move(inner)), config_(std::move(config)), entry_(announcer, config_.node, inner_->gid(), false) {}

  std::size_t take(std::span<Sample> out) override { return inner_->take(out); }
  void on_data(Notify notify) override { inner_->on_data(std::move(notify)); }
  LinkStats stats() const override { return inner_->stats(); }
  const EndpointConfig& config() const override { return config_; }
  Gid gid() const override { return inner_->gid(); }

 private:
  std::unique_ptr<Reader> inner_;
  EndpointConfig config_;
  Announcement entry_;
};

class RosParticipant final : public Participant {
 public:
  RosParticipant(std::unique_ptr<Participant> inner, std::unique_ptr<NodeAnnouncer> announcer, GidForm form)
      : inner_(std::move(inner)), announcer_(std::move(announcer)), form_(form) {}

  Result<std::unique_ptr<Writer>> writer(const EndpointConfig& config) override {
    Result<EndpointConfig> raw = to_raw(config);
    if (!raw) return raw.error();
    Result<std::unique_ptr<Writer>> writer = inner_->writer(*raw);
    if (!writer) return writer;
    return std::unique_ptr<Writer>(std::make_unique<RosWriter>(*std::move(writer), config, announcer_.get()));
  }

  Result<std::unique_ptr<Reader>> reader(const EndpointConfig& config) override {
    Result<EndpointConfig> raw = to_raw(config);
    if (!raw) return raw.error();
    Result<std::unique_ptr<Reader>> reader = inner_->reader(*raw);
    if (!reader) return reader;
    return std::unique_ptr<Reader>(std::make_unique<RosReader>(*std::move(reader), config, announcer_.get()));
  }

  Graph graph() const override;

  void on_event(EventHandler handler) override {
    if (!handler) return inner_->on_event(nullptr);
    inner_->on_event([handler = std::move(handler)](const Event& event) {
      Event renamed = event;
      renamed.topic = from_dds_topic(event.topic);
      handler(renamed);
    });
  }

  std::string explain() const override {
    return inner_->explain() + "ROS graph: " +
           (announcer_ ? "announced on ros_discovery_info, form of " + config().ros_distro + "\n" : "not announced\n");
  }
  const ParticipantConfig& config() const override { return inner_->config(); }
  Gid gid() const override { return inner_->gid(); }

 private:
  Result<EndpointConfig> to_raw(const EndpointConfig& config) const {
    EndpointConfig raw = config;
    if (config.topic.starts_with('/')) {
      if (Result<void> valid = validate_ros_name(config.topic); !valid) return valid.error();
      if (Result<void> valid = validate_ros_name(config.node); !valid) return valid.error();
      raw.topic = to_dds_topic(config.topic);
      // Humble announces no hash; everybody later does, and warns about endpoints without one.
      if (announcer_ && form_ != GidForm::humble_24) {
        raw.user_data = "typehash=" + std::string(config.type->type_hash) + ";";
      }
    }
    return raw;
  }
  void read_discovery() const;

  std::unique_ptr<Participant> inner_;
  std::unique_ptr<NodeAnnouncer> announcer_;  // null: stay out of the ROS graph; before inner_'s end by order
  GidForm form_;
  mutable std::mutex mutex_;  // guards what graph() learns
  mutable std::unique_ptr<Reader> discovery_;
  mutable std::map<Gid, DiscoveryInfo> others_;
};

void RosParticipant::read_discovery() const {
  if (!discovery_) {
    EndpointConfig config;
    config.topic = discovery_topic;
    config.type = &discovery_type(form_);
    config.qos = Qos::latched(0);
    config.ignore_local = true;
    Result<std::unique_ptr<Reader>> reader = inner_->reader(config);
    if (!reader) return;
    discovery_ = *std::move(reader);
  }
  Sample sample;
  while (discovery_->take({&sample, 1}) == 1) {
    DiscoveryInfo info;
    if (decode_discovery(sample.bytes(), info)) others_[info.participant] = std::move(info);
  }
}

Graph RosParticipant::graph() const {
  Graph graph = inner_->graph();
  const std::lock_guard lock(mutex_);
  read_discovery();
  // A participant that left takes its nodes with it.
  std::erase_if(others_, [&](const auto& entry) {
    return std::none_of(graph.participants.begin(), graph.participants.end(),
                        [&](const ParticipantInfo& p) { return p.gid.same_participant(entry.first); });
  });
  std::map<Gid, std::string> owner;
  std::set<std::string> nodes;
  const auto enter = [&](const DiscoveryInfo& info) {
    for (const auto& [name, endpoints] : info.nodes) {
      nodes.insert(name);
      for (const Gid& gid : endpoints.readers) owner[gid] = name;
      for (const Gid& gid : endpoints.writers) owner[gid] = name;
    }
  };
  for (const auto& [gid, info] : others_) enter(info);
  if (announcer_) enter(announcer_->info());

  for (EndpointInfo& endpoint : graph.endpoints) {
    endpoint.topic = from_dds_topic(endpoint.dds_topic);
    endpoint.type = from_dds_type(endpoint.dds_type);
    const auto node = owner.find(endpoint.gid);
    if (node != owner.end()) endpoint.node = node->second;
  }
  graph.nodes.assign(nodes.begin(), nodes.end());
  return graph;
}

}  // namespace

Result<void> validate_ros_distro(const std::string& distro) {
  for (const char* known : {"humble", "iron", "jazzy", "none"}) {
    if (distro == known) return {};
  }
  return Error{ErrorCode::invalid_argument,
               "ros_distro '" + distro + "' is unknown: give humble, iron, jazzy (also for later ones) or none"};
}

std::string ros_participant_user_data(const ParticipantConfig& config) {
  if (config.ros_distro == "none") return {};
  return "enclave=" + (config.security ? config.security->enclave : std::string("/")) + ";";
}

Result<std::unique_ptr<Participant>> make_ros_participant(std::unique_ptr<Participant> inner) {
  const ParticipantConfig& config = inner->config();
  const GidForm form = config.ros_distro == "humble" ? GidForm::humble_24 : GidForm::iron_16;
  std::unique_ptr<NodeAnnouncer> announcer;
  if (config.ros_distro != "none") {
    EndpointConfig endpoint;
    endpoint.topic = discovery_topic;
    endpoint.type = &discovery_type(form);
    endpoint.qos = Qos::latched(1);
    if (form != GidForm::humble_24) endpoint.user_data = "typehash=" + std::string(endpoint.type->type_hash) + ";";
    Result<std::unique_ptr<Writer>> writer = inner->writer(endpoint);
    if (!writer) return writer.error();
    announcer = std::make_unique<NodeAnnouncer>(*std::move(writer), inner->gid(), form);
  }
  return std::unique_ptr<Participant>(std::make_unique<RosParticipant>(std::move(inner), std::move(announcer), form));
}

}  // namespace adit
