#include "components/runtime/message_pool.hpp"

#include <algorithm>
#include <mutex>
#include <new>
#include <utility>

namespace adit {

// A message and the memory for the control block of the shared_ptr that hands it out.
struct MessagePool::Slot {
  Shared* pool;
  Slot* next = nullptr;
  void* message;
  alignas(std::max_align_t) std::byte control_block[96];
};

// Outlives the pool object until the last message is back.
struct MessagePool::Shared {
  Shared(const ErasedType& t, std::size_t c) : type(t), capacity(c) {}

  const ErasedType& type;
  const std::size_t capacity;
  std::mutex mutex;
  Slot* free = nullptr;
  std::size_t built = 0;
  std::size_t out = 0;
  std::uint64_t misses = 0;
  bool closed = false;

  std::size_t message_offset() const { return (sizeof(Slot) + type.alignment - 1) / type.alignment * type.alignment; }
  std::align_val_t alignment() const { return std::align_val_t(std::max(alignof(Slot), type.alignment)); }

  Slot* build() {
    auto* const memory = static_cast<std::byte*>(::operator new(message_offset() + type.size, alignment()));
    Slot* const slot = new (memory) Slot{this, nullptr, memory + message_offset(), {}};
    type.construct(slot->message);
    return slot;
  }

  void destroy(Slot* slot) {
    type.destroy(slot->message);
    slot->~Slot();
    ::operator delete(slot, alignment());
  }

  void give_back(Slot* slot) noexcept {
    bool surplus, last;
    {
      const std::lock_guard lock(mutex);
      --out;
      surplus = closed || built > capacity;
      if (surplus) {
        --built;
      } else {
        slot->next = free;
        free = slot;
      }
      last = closed && out == 0;
    }
    if (surplus) destroy(slot);
    if (last) delete this;
  }
};

// Called when the last owner lets the message go.
struct MessagePool::Return {
  const ErasedType* type;
  void operator()(void* message) const noexcept { type->release(message); }
};

// Puts the shared_ptr's control block into the slot; the slot is free again once that is gone.
template <class U>
struct MessagePool::ControlBlockMemory {
  using value_type = U;
  Slot* slot;
  explicit ControlBlockMemory(Slot* s) : slot(s) {}
  template <class V>
  ControlBlockMemory(const ControlBlockMemory<V>& other) : slot(other.slot) {}  // NOLINT: allocator requirement
  U* allocate(std::size_t) {
    static_assert(sizeof(U) <= sizeof(Slot::control_block) && alignof(U) <= alignof(std::max_align_t));
    return reinterpret_cast<U*>(slot->control_block);
  }
  void deallocate(U*, std::size_t) noexcept { slot->pool->give_back(slot); }
  template <class V>
  friend bool operator==(const ControlBlockMemory& a, const ControlBlockMemory<V>& b) {
    return a.slot == b.slot;
  }
};

MessagePool::MessagePool(const ErasedType& type, std::size_t capacity) : shared_(new Shared(type, capacity)) {
  for (; shared_->built < capacity; ++shared_->built) {
    Slot* const slot = shared_->build();
    slot->next = shared_->free;
    shared_->free = slot;
  }
}

MessagePool::~MessagePool() {
  Slot* unused;
  bool last;
  {
    const std::lock_guard lock(shared_->mutex);
    shared_->closed = true;
    unused = std::exchange(shared_->free, nullptr);
    last = shared_->out == 0;
  }
  while (unused) shared_->destroy(std::exchange(unused, unused->next));
  if (last) delete shared_;
}

std::shared_ptr<void> MessagePool::acquire() {
  Slot* slot = nullptr;
  {
    const std::lock_guard lock(shared_->mutex);
    ++shared_->out;
    if (shared_->free) {
      slot = shared_->free;
      shared_->free = slot->next;
    } else {
      ++shared_->built;
      ++shared_->misses;
    }
  }
  if (!slot) slot = shared_->build();
  return {slot->message, Return{&shared_->type}, ControlBlockMemory<std::byte>(slot)};
}

std::uint64_t MessagePool::misses() const {
  const std::lock_guard lock(shared_->mutex);
  return shared_->misses;
}

}  // namespace adit
