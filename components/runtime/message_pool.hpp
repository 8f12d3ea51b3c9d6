// Messages that are built once and used again and again, handed out as shared_ptr without touching the heap.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "components/runtime/erased_type.hpp"

namespace adit {

// Keeps up to `capacity` messages. Thread-safe. Messages may outlive the pool. When all are out, acquire() takes one
// from the heap instead and counts a miss: somebody holds on to more messages than the pool was made for.
class MessagePool {
 public:
  // Builds `capacity` messages at once, so that none is built on the data path.
  MessagePool(const ErasedType& type, std::size_t capacity);
  ~MessagePool();
  MessagePool(const MessagePool&) = delete;
  MessagePool& operator=(const MessagePool&) = delete;

  // A message with whatever content its last user left, minus views of received samples.
  std::shared_ptr<void> acquire();
  std::uint64_t misses() const;

 private:
  struct Shared;
  struct Slot;
  struct Return;
  template <class U>
  struct ControlBlockMemory;
  Shared* shared_;
};

}  // namespace adit
