#include "components/runtime/local_bus.hpp"

#include "components/runtime/input.hpp"
#include "components/runtime/output.hpp"

namespace adit {

void LocalTopic::attach(InputBase& input) {
  const std::unique_lock lock(mutex_);
  inputs_.push_back(&input);
  for (OutputBase* output : outputs_) {
    output->update_local_links(inputs_);
    output->replay_to(input);
  }
}

void LocalTopic::detach(InputBase& input) {
  const std::unique_lock lock(mutex_);
  std::erase(inputs_, &input);
  for (OutputBase* output : outputs_) output->update_local_links(inputs_);
}

void LocalTopic::attach(OutputBase& output) {
  const std::unique_lock lock(mutex_);
  outputs_.push_back(&output);
  output.update_local_links(inputs_);
}

void LocalTopic::detach(OutputBase& output) {
  const std::unique_lock lock(mutex_);
  std::erase(outputs_, &output);
  output.update_local_links({});
}

void LocalTopic::tap(Tap tap) {
  const std::unique_lock lock(mutex_);
  taps_.push_back(std::move(tap));
}

void LocalTopic::publish(OutputBase& from, const std::shared_ptr<const void>& message, const MessageInfo& info) {
  const std::shared_lock lock(mutex_);
  from.deliver_locally(message, info);
  for (const Tap& tap : taps_) tap(from.type(), message, info);
}

void LocalTopic::inject(const std::shared_ptr<const void>& object, Bytes cdr, const KeepAlive& memory,
                        const MessageInfo& info) {
  const std::shared_lock lock(mutex_);
  for (InputBase* input : inputs_) {
    if (object) {
      input->offer(object, info, Duration::zero());
    } else {
      input->offer(Sample(cdr, info, memory));
    }
  }
}

std::size_t LocalTopic::readers(const OutputBase& from) const {
  const std::shared_lock lock(mutex_);
  return from.local_links() + taps_.size();
}

bool LocalTopic::has_inputs() const {
  const std::shared_lock lock(mutex_);
  return !inputs_.empty();
}

const ErasedType* LocalTopic::type() const {
  const std::shared_lock lock(mutex_);
  if (!inputs_.empty()) return &inputs_.front()->type();
  if (!outputs_.empty()) return &outputs_.front()->type();
  return nullptr;
}

LocalTopic& LocalBus::topic(const std::string& name) {
  const std::lock_guard lock(mutex_);
  std::unique_ptr<LocalTopic>& topic = topics_[name];
  if (!topic) topic = std::make_unique<LocalTopic>(name);
  return *topic;
}

}  // namespace adit
