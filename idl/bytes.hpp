// Raw payload bytes and shared ownership of memory that somebody else manages.
#pragma once

#include <cstddef>
#include <span>
#include <utility>

namespace adit {

using Bytes = std::span<const std::byte>;
using MutableBytes = std::span<std::byte>;

// How a KeepAlive's handle is retained and released. Both are thread-safe and do not throw; the object lives for ever
// (a constant), the handle until its count falls to zero.
struct KeepAliveOperations {
  void (*retain)(void* handle) noexcept;
  void (*release)(void* handle) noexcept;
};

// A counted reference to foreign memory (a vendor's received sample, a shared-memory chunk). Copying retains,
// destroying releases; neither allocates. Empty by default. Any thread.
class KeepAlive {
 public:
  KeepAlive() = default;
  // Takes over one reference that the caller already holds.
  KeepAlive(const KeepAliveOperations* operations, void* handle) noexcept : operations_(operations), handle_(handle) {}
  KeepAlive(const KeepAlive& other) noexcept : operations_(other.operations_), handle_(other.handle_) {
    if (operations_) operations_->retain(handle_);
  }
  KeepAlive(KeepAlive&& other) noexcept
      : operations_(std::exchange(other.operations_, nullptr)), handle_(std::exchange(other.handle_, nullptr)) {}
  KeepAlive& operator=(KeepAlive other) noexcept {
    std::swap(operations_, other.operations_);
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~KeepAlive() {
    if (operations_) operations_->release(handle_);
  }
  explicit operator bool() const noexcept { return operations_ != nullptr; }

 private:
  const KeepAliveOperations* operations_ = nullptr;
  void* handle_ = nullptr;
};

}  // namespace adit
