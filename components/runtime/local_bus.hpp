// Same-process delivery: an output hands its message to the inputs of the process as the pointer it is.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <shared_mutex>
#include <span>
#include <string>
#include <vector>

#include "components/runtime/erased_type.hpp"
#include "middleware/sample.hpp"

namespace adit {

class InputBase;
class OutputBase;

// Sees every message published on a topic, in the publisher's thread.
using Tap = std::function<void(const ErasedType&, const std::shared_ptr<const void>&, const MessageInfo&)>;

// One topic: its inputs and outputs within the process. Thread-safe.
class LocalTopic {
 public:
  explicit LocalTopic(std::string name) : name_(std::move(name)) {}
  const std::string& name() const { return name_; }

  // `link` follows the request/offer rules of DDS: an input only hears outputs whose QoS and type match its own.
  // attach(input) replays what latched outputs retain.
  void attach(InputBase& input);
  void detach(InputBase& input);
  void attach(OutputBase& output);
  void detach(OutputBase& output);
  void tap(Tap tap);

  // Hands `message` to every input linked to `from`, and retains it there when `from` is latched.
  void publish(OutputBase& from, const std::shared_ptr<const void>& message, const MessageInfo& info);
  // The offline runner's way in: an object, or a serialized sample, to every input of the topic.
  void inject(const std::shared_ptr<const void>& object, Bytes cdr, const KeepAlive& memory, const MessageInfo& info);
  std::size_t readers(const OutputBase& from) const;
  bool has_inputs() const;
  // The type of the topic's first port; nullptr without one.
  const ErasedType* type() const;

 private:
  const std::string name_;
  mutable std::shared_mutex mutex_;
  std::vector<InputBase*> inputs_;
  std::vector<OutputBase*> outputs_;
  std::vector<Tap> taps_;
};

// The topics of one process. Topics live as long as the bus.
class LocalBus {
 public:
  LocalTopic& topic(const std::string& name);

 private:
  std::mutex mutex_;
  std::map<std::string, std::unique_ptr<LocalTopic>> topics_;
};

}  // namespace adit
