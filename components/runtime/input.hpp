// Where messages enter a component.
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "components/runtime/message_pool.hpp"
#include "components/runtime/port.hpp"
#include "idl/result.hpp"
#include "middleware/sample.hpp"

namespace adit {

class Component;
class ComponentCore;
class LocalBus;
class LocalTopic;
class Participant;
class Reader;

// Everything of an input that does not depend on the message type.
class InputBase {
 public:
  using ErasedHandler = std::function<void(const std::shared_ptr<const void>&, const MessageInfo&)>;

  InputBase(const InputBase&) = delete;
  InputBase& operator=(const InputBase&) = delete;

  const std::string& name() const { return name_; }
  const std::string& topic() const { return topic_name_; }
  const ErasedType& type() const { return type_; }
  PortInfo info() const;
  InputStats stats() const;

  // From a publisher of this process, or from the offline runner. Any thread.
  void offer(const std::shared_ptr<const void>& message, const MessageInfo& info, Duration max_blocking);
  void offer(Sample sample);

 protected:
  InputBase(Component& owner, std::string name, const ErasedType& type, const Qos& qos, const Queue& queue,
            ErasedHandler handler);
  ~InputBase();

 private:
  friend class ComponentCore;
  friend class OutputBase;
  struct Waiting {
    std::shared_ptr<const void> message;  // either this
    Sample sample;                        // or this
    MessageInfo info;
    std::uint64_t order = 0;  // of arrival at the component
  };

  // The component's side; see component_core.hpp for when.
  void bind(std::string topic, const Queue& queue, Qos::Reliability reliability);
  Result<void> open(Participant* participant, LocalBus& bus);
  void start();
  void stop();
  void close();
  void drain_reader();
  std::optional<std::uint64_t> next_order() const;  // caller holds the queue mutex
  void handle_next();

  bool full() const { return !unbounded_ && count_ >= ring_.size(); }
  void push(Waiting&& waiting);  // caller holds the queue mutex and knows there is room
  Waiting pop();
  bool admit(Waiting&& waiting, Waiting& dropped);
  void discard_unread();

  ComponentCore& core_;
  const std::string name_;
  const ErasedType& type_;
  Qos qos_;  // fixed by bind()
  const ErasedHandler handler_;
  Queue queue_;
  std::string topic_name_;
  LocalTopic* topic_ = nullptr;
  mutable std::mutex endpoint_mutex_;  // reader_ and pool_ against stats()
  std::unique_ptr<Reader> reader_;
  std::optional<MessagePool> pool_;

  // Guarded by the component's queue mutex.
  std::vector<Waiting> ring_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  bool accepting_ = false;
  bool unbounded_ = false;
  std::uint64_t dropped_ = 0;
  std::condition_variable space_;

  std::array<Sample, 8> taken_;  // used by the strand only
  std::atomic<bool> reader_ready_{false};
  std::atomic<std::uint64_t> handled_{0};
  std::atomic<std::uint64_t> refused_{0};
  std::atomic<const char*> last_refusal_{""};
};

// Receives messages of type T and calls `handler` for each, in the component's strand, while the component is active.
// The handler takes (const T&, const MessageInfo&), or (std::shared_ptr<const T>, const MessageInfo&) to keep the
// message. Messages of this process arrive as the very object that was published; others are decoded in the strand into
// pooled messages whose blobs view the received sample. A component may hold on to a few messages (they hold the
// middleware's memory); the pool has `queue.size + 4`.
template <class T>
class Input final : public InputBase {
 public:
  template <class Handler>
  Input(Component& owner, std::string name, const Qos& qos, const Queue& queue, Handler handler)
      : InputBase(owner, std::move(name), erased_type<T>(), qos, queue, erase(std::move(handler))) {}
  template <class Handler>
  Input(Component& owner, std::string name, const Qos& qos, Handler handler)
      : Input(owner, std::move(name), qos, Queue{}, std::move(handler)) {}

 private:
  template <class Handler>
  static ErasedHandler erase(Handler handler) {
    if constexpr (std::is_invocable_v<Handler&, const T&, const MessageInfo&>) {
      return
          [handler = std::move(handler)](const std::shared_ptr<const void>& message, const MessageInfo& info) mutable {
            handler(*static_cast<const T*>(message.get()), info);
          };
    } else {
      static_assert(std::is_invocable_v<Handler&, std::shared_ptr<const T>, const MessageInfo&>,
                    "a handler takes (const T&, const MessageInfo&) or (std::shared_ptr<const T>, const MessageInfo&)");
      return
          [handler = std::move(handler)](const std::shared_ptr<const void>& message, const MessageInfo& info) mutable {
            handler(std::static_pointer_cast<const T>(message), info);
          };
    }
  }
};

}  // namespace adit
