#include "components/runtime/output.hpp"

#include <algorithm>

#include "components/runtime/component.hpp"
#include "components/runtime/component_core.hpp"
#include "components/runtime/local_bus.hpp"
#include "middleware/participant.hpp"

namespace adit {
namespace {

constexpr std::size_t spare_messages = 4;   // being filled, being handled
constexpr std::size_t max_retained = 1000;  // of a latched output that keeps all

}  // namespace

OutputBase::OutputBase(Component& owner, std::string name, const ErasedType& type, const Qos& qos)
    : core_(owner.core()), name_(std::move(name)), type_(type), qos_(qos) {
  core_.add(*this);
}

OutputBase::~OutputBase() {
  stop();
  close();
  core_.remove(*this);
}

PortInfo OutputBase::info() const {
  return {PortInfo::Direction::output, core_.full_name(), name_, topic_name_, type_.info, qos_, {}};
}

OutputStats OutputBase::stats() const {
  OutputStats stats;
  stats.published = sequence_;
  stats.refused = refused_;
  const std::lock_guard lock(endpoint_mutex_);
  if (topic_) stats.local_readers = static_cast<std::uint32_t>(topic_->readers(*this));
  if (pool_) stats.pool_misses = pool_->misses();
  if (writer_) stats.link = writer_->stats();
  return stats;
}

bool OutputBase::has_readers() const {
  return wanted_locally() || (writer_ && writer_->has_remote_readers());
}

bool OutputBase::wanted_locally() const {
  return latched() || (topic_ && topic_->readers(*this) > 0);
}

// --- Lifecycle ---

void OutputBase::bind(std::string topic) {
  topic_name_ = std::move(topic);
}

Result<void> OutputBase::open(Participant* participant, LocalBus& bus) {
  const std::size_t depth = qos_.depth == 0 ? max_retained : std::min<std::size_t>(qos_.depth, max_retained);
  retained_.clear();
  retained_.reserve(depth);
  const std::lock_guard lock(endpoint_mutex_);
  topic_ = &bus.topic(topic_name_);
  pool_.emplace(type_, std::min<std::size_t>(depth, 16) + spare_messages);
  if (!participant) return {};
  EndpointConfig config;
  config.topic = topic_name_;
  config.type = type_.info;
  config.qos = qos_;
  config.node = core_.full_name();
  config.ignore_local = true;
  auto writer = participant->writer(config);
  if (!writer) return writer.error();
  writer_ = std::move(*writer);
  return {};
}

void OutputBase::start() {
  if (active_.exchange(true)) return;
  topic_->attach(*this);
}

void OutputBase::stop() {
  if (!active_.exchange(false)) return;
  topic_->detach(*this);
}

void OutputBase::close() {
  retained_.clear();
  retained_next_ = 0;
  const std::lock_guard lock(endpoint_mutex_);
  writer_.reset();
  pool_.reset();
}

// --- Publishing ---

bool OutputBase::accepts() {
  if (active_.load(std::memory_order_acquire)) return true;
  refused_.fetch_add(1, std::memory_order_relaxed);
  return false;
}

MessageInfo OutputBase::next_info() {
  MessageInfo info;
  info.source_time = info.received_time = core_.message_now();
  if (writer_) info.writer = writer_->gid();
  info.sequence = sequence_.fetch_add(1, std::memory_order_relaxed) + 1;
  return info;
}

std::shared_ptr<void> OutputBase::loan_erased() {
  if (pool_) return pool_->acquire();
  // Not configured: the loan still has to be something to write to; publishing it will be refused.
  return MessagePool(type_, 0).acquire();
}

bool OutputBase::publish_copy(const void* message) {
  if (!accepts()) return false;
  if (wanted_locally()) {
    const std::shared_ptr<void> copy = pool_->acquire();
    type_.assign(copy.get(), message);
    return publish_shared(copy);
  }
  return send(message, next_info());
}

bool OutputBase::publish_shared(const std::shared_ptr<const void>& message) {
  if (!message || !accepts()) return false;
  const MessageInfo info = next_info();
  topic_->publish(*this, message, info);
  return send(message.get(), info);
}

bool OutputBase::send(const void* message, const MessageInfo& info) {
  if (!writer_ || (!latched() && !writer_->has_remote_readers())) return true;
  if (writer_->publish(ErasedEncoder(type_, message), info.source_time)) return true;
  refused_.fetch_add(1, std::memory_order_relaxed);
  return false;
}

// --- The local side, called with the topic's lock held ---

void OutputBase::update_local_links(std::span<InputBase* const> inputs) {
  links_.clear();
  std::vector<InputBase*> refused;
  for (InputBase* input : inputs) {
    const bool same_type = input->type_.info->dds_name == type_.info->dds_name;
    const std::vector<Mismatch> mismatches = check(qos_, input->qos_);
    if (same_type && mismatches.empty()) {
      links_.push_back(input);
      continue;
    }
    refused.push_back(input);
    if (std::find(refused_links_.begin(), refused_links_.end(), input) != refused_links_.end()) continue;
    if (!same_type) {
      core_.log().error("{}: this output has type {}, the input '{}' of {} has type {}: not connected", topic_name_,
                        type_.info->ros_name, input->name_, input->core_.full_name(), input->type_.info->ros_name);
    }
    for (const Mismatch& mismatch : mismatches) {
      core_.log().error("{}: not connected to the input '{}' of {}: {} offered is {}, requested is {}; {}", topic_name_,
                        input->name_, input->core_.full_name(), mismatch.policy, mismatch.offered, mismatch.requested,
                        mismatch.remedy);
    }
  }
  refused_links_ = std::move(refused);
}

void OutputBase::deliver_locally(const std::shared_ptr<const void>& message, const MessageInfo& info) {
  for (InputBase* input : links_) input->offer(message, info, qos_.max_blocking);
  if (!latched()) return;
  const std::lock_guard lock(retained_mutex_);
  if (retained_.size() < retained_.capacity()) {
    retained_.push_back({message, info});
  } else {
    retained_[retained_next_] = {message, info};
    retained_next_ = (retained_next_ + 1) % retained_.size();
  }
}

void OutputBase::replay_to(InputBase& input) {
  if (!latched() || input.qos_.durability != Qos::Durability::transient_local) return;
  if (std::find(links_.begin(), links_.end(), &input) == links_.end()) return;
  const std::lock_guard lock(retained_mutex_);
  for (std::size_t i = 0; i < retained_.size(); ++i) {
    const Retained& retained = retained_[(retained_next_ + i) % retained_.size()];
    input.offer(retained.message, retained.info, Duration::zero());
  }
}

}  // namespace adit
