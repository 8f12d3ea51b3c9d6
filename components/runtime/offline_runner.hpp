// The deterministic runner: the components of a deployment on one thread, without middleware, in simulated time.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "components/runtime/component_config.hpp"
#include "components/runtime/erased_type.hpp"
#include "middleware/sample.hpp"

namespace adit {

class Component;

// A recorded or simulated message: either serialized, or an object of the topic's type.
struct OfflineMessage {
  std::string topic;
  Time stamp{};
  Bytes cdr;  // with its encapsulation header; valid while `memory` is held, or until the next next() without one
  KeepAlive memory;                    // empty: inputs copy what they need while the message is handled
  std::shared_ptr<const void> object;  // used instead of `cdr` when set ...
  const ErasedType* type = nullptr;    // ... and of this type
};

template <class T>
OfflineMessage offline_message(std::string topic, Time stamp, std::shared_ptr<const T> message) {
  return {std::move(topic), stamp, {}, {}, std::move(message), &erased_type<T>()};
}

// Messages in the order of their stamps (equal stamps: in this order).
class OfflineSource {
 public:
  virtual ~OfflineSource() = default;
  // False at the end.
  virtual Result<bool> next(OfflineMessage& out) = 0;
};

struct OfflineStats {
  std::uint64_t delivered = 0;     // messages that some component listens to
  std::uint64_t unheard = 0;       // messages of topics nobody listens to
  std::uint64_t out_of_order = 0;  // stamped before their predecessor: handled at the predecessor's time
  Time first{}, last{};
};

// One thread throughout. Same components, same source: bit-identical outputs. Each message is handled to the end, with
// everything it causes, before time moves on; timers fire at their simulated time in between; queues do not drop.
class OfflineRunner {
 public:
  static Result<std::unique_ptr<OfflineRunner>> build(const std::vector<ComponentConfig>& components);
  ~OfflineRunner();
  OfflineRunner(const OfflineRunner&) = delete;
  OfflineRunner& operator=(const OfflineRunner&) = delete;

  // Sees every message that a component publishes on `topic`; the message may be kept.
  using Sink = std::function<void(const ErasedType&, const std::shared_ptr<const void>&, const MessageInfo&)>;
  void tap(const std::string& topic, Sink sink);
  // Serialized, as a recorder wants it.
  void tap_cdr(const std::string& topic, std::function<void(Bytes, Time)> sink);

  // Configures, activates at the first stamp, runs to the end of the source, deactivates and cleans up. A component
  // that throws, and a message that its input refuses, end the run with an error.
  Result<OfflineStats> run(OfflineSource& source);

  std::vector<PortInfo> ports() const;
  std::vector<ComponentStatus> status() const;

 private:
  OfflineRunner();
  Result<void> start();
  void advance_to(Time time);
  Result<bool> deliver(const OfflineMessage& message);
  Result<void> check_components() const;
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace adit
