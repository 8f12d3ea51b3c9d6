// Work that somebody else asks for.
#pragma once

#include <atomic>
#include <functional>
#include <string>

namespace adit {

class Component;
class ComponentCore;

// Calls `handler` in the component's strand soon after raise(), while the component is active. Raised several times
// before the handler starts, it is called once; what was raised while the component was not active is forgotten.
class Trigger {
 public:
  Trigger(Component& owner, std::function<void()> handler);
  ~Trigger();
  Trigger(const Trigger&) = delete;
  Trigger& operator=(const Trigger&) = delete;

  // Any thread; never blocks longer than a short lock, never allocates.
  void raise();

 private:
  friend class ComponentCore;
  bool raised() const { return raised_.load(std::memory_order_acquire); }
  bool take() { return raised_.exchange(false, std::memory_order_acq_rel); }

  ComponentCore& core_;
  const std::function<void()> handler_;
  std::atomic<bool> raised_{false};
};

}  // namespace adit
