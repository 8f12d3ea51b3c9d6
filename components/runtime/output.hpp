// Where messages leave a component.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "components/runtime/message_pool.hpp"
#include "components/runtime/port.hpp"
#include "idl/result.hpp"
#include "middleware/sample.hpp"

namespace adit {

class Component;
class ComponentCore;
class InputBase;
class LocalBus;
class LocalTopic;
class Participant;
class Writer;

// Everything of an output that does not depend on the message type.
class OutputBase {
 public:
  OutputBase(const OutputBase&) = delete;
  OutputBase& operator=(const OutputBase&) = delete;

  const std::string& name() const { return name_; }
  const std::string& topic() const { return topic_name_; }
  const ErasedType& type() const { return type_; }
  PortInfo info() const;
  OutputStats stats() const;
  // Somebody listens, in this process or elsewhere: what costs much to make need not be made otherwise.
  bool has_readers() const;

  // LocalTopic's side: called with its lock held.
  void update_local_links(std::span<InputBase* const> inputs);
  std::size_t local_links() const { return links_.size(); }
  void deliver_locally(const std::shared_ptr<const void>& message, const MessageInfo& info);
  void replay_to(InputBase& input);

 protected:
  OutputBase(Component& owner, std::string name, const ErasedType& type, const Qos& qos);
  ~OutputBase();
  std::shared_ptr<void> loan_erased();
  bool publish_copy(const void* message);
  bool publish_shared(const std::shared_ptr<const void>& message);

 private:
  friend class ComponentCore;
  struct Retained {
    std::shared_ptr<const void> message;
    MessageInfo info;
  };

  void bind(std::string topic);
  Result<void> open(Participant* participant, LocalBus& bus);
  void start();
  void stop();
  void close();

  bool latched() const { return qos_.durability == Qos::Durability::transient_local; }
  bool accepts();
  bool wanted_locally() const;
  MessageInfo next_info();
  bool send(const void* message, const MessageInfo& info);

  ComponentCore& core_;
  const std::string name_;
  const ErasedType& type_;
  const Qos qos_;
  std::string topic_name_;
  LocalTopic* topic_ = nullptr;
  mutable std::mutex endpoint_mutex_;  // writer_ and pool_ against stats()
  std::unique_ptr<Writer> writer_;
  std::optional<MessagePool> pool_;
  std::vector<InputBase*> links_;          // guarded by the topic's lock
  std::vector<InputBase*> refused_links_;  // the same; what was reported already
  std::mutex retained_mutex_;
  std::vector<Retained> retained_;  // ring of the last qos.depth messages of a latched output
  std::size_t retained_next_ = 0;
  std::atomic<bool> active_{false};
  std::atomic<std::uint64_t> sequence_{0};
  std::atomic<std::uint64_t> refused_{0};
};

// A pooled message that is being filled; nobody else sees it until it is published. Its content is whatever its last
// user left: set every field. Move-only.
template <class T>
class Loan {
 public:
  Loan(Loan&&) noexcept = default;
  Loan& operator=(Loan&&) noexcept = default;
  T& operator*() const { return *message_; }
  T* operator->() const { return message_.get(); }

 private:
  template <class>
  friend class Output;
  explicit Loan(std::shared_ptr<T> message) : message_(std::move(message)) {}
  std::shared_ptr<T> message_;
};

// Publishes messages of type T on one topic, while the component is active. Inputs of the same process get the object
// itself, never a copy of a loan; the message is encoded once, straight into the middleware's buffer, and only when
// somebody outside the process listens (or the QoS is latched). Any thread. publish() returns false when the message
// went nowhere it should have gone (component not active, refused by the middleware): that is counted and shown in
// /diagnostics.
template <class T>
class Output final : public OutputBase {
 public:
  Output(Component& owner, std::string name, const Qos& qos)
      : OutputBase(owner, std::move(name), erased_type<T>(), qos) {}

  // Copies `message` into a pooled one if this process listens.
  bool publish(const T& message) { return publish_copy(&message); }
  bool publish(Loan<T> loan) { return publish_shared(std::move(loan.message_)); }
  // Hands on a message that others may hold already: nobody may change it any more.
  bool publish(std::shared_ptr<const T> message) { return publish_shared(std::move(message)); }
  Loan<T> loan() { return Loan<T>(std::static_pointer_cast<T>(loan_erased())); }
};

}  // namespace adit
