// A message type behind void pointers, so that queues, pools and ports are compiled once and not once a type.
#pragma once

#include <array>
#include <cstddef>
#include <new>
#include <vector>

#include "idl/blob.hpp"
#include "idl/codec.hpp"

namespace adit {

// Static storage; `message` is always a pointer to one constructed object of the type.
struct ErasedType {
  const TypeInfo* info;
  std::size_t size;
  std::size_t alignment;
  void (*construct)(void* memory);
  void (*destroy)(void* message) noexcept;
  void (*assign)(void* to, const void* from);
  // Lets received samples go that the message views, and keeps the memory it owns for the next use.
  void (*release)(void* message) noexcept;
  std::size_t (*encoded_size)(const void* message);
  std::size_t (*encode)(const void* message, MutableBytes out);
  // nullptr, or why the bytes were refused (static text). Blobs view `cdr` and hold `memory`.
  const char* (*decode)(Bytes cdr, const KeepAlive& memory, void* message);
};

// Writes an erased message into the middleware's buffer.
class ErasedEncoder final : public Encoder {
 public:
  ErasedEncoder(const ErasedType& type, const void* message) : type_(type), message_(message) {}
  std::size_t size() const override { return type_.encoded_size(message_); }
  std::size_t write(MutableBytes out) const override { return type_.encode(message_, out); }

 private:
  const ErasedType& type_;
  const void* message_;
};

namespace detail {

// Visits the fields of a message, and of the messages in it, down to every Blob.
struct ReleaseViews {
  template <class T>
  void operator()(const char*, T& value) const {
    release(value);
  }
  static void release(Blob& blob) {
    if (blob.is_view()) blob.clear();
  }
  template <Message T>
  static void release(T& message) {
    for_each_field(message, ReleaseViews{});
  }
  template <class T>
  static void release(std::vector<T>& values) {
    if constexpr (Message<T>) {
      for (T& value : values) release(value);
    }
  }
  template <class T, std::size_t N>
  static void release(std::array<T, N>& values) {
    if constexpr (Message<T>) {
      for (T& value : values) release(value);
    }
  }
  template <class T>
  static void release(T&) {}
};

}  // namespace detail

// The operations of a generated message type.
template <Message T>
const ErasedType& erased_type() {
  static const ErasedType type = {
      &type_info<T>(),
      sizeof(T),
      alignof(T),
      [](void* memory) { new (memory) T(); },
      [](void* message) noexcept { static_cast<T*>(message)->~T(); },
      [](void* to, const void* from) { *static_cast<T*>(to) = *static_cast<const T*>(from); },
      [](void* message) noexcept { detail::ReleaseViews::release(*static_cast<T*>(message)); },
      [](const void* message) { return encoded_size(*static_cast<const T*>(message)); },
      [](const void* message, MutableBytes out) { return encode(*static_cast<const T*>(message), out); },
      [](Bytes cdr, const KeepAlive& memory, void* message) -> const char* {
        const DecodeStatus status = decode(cdr, *static_cast<T*>(message), memory);
        return status == DecodeStatus::ok ? nullptr : to_string(status).data();
      }};
  return type;
}

}  // namespace adit
