// The C++ type of an IDL sequence<uint8>: image pixels, point clouds, packets.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <span>

#include "idl/bytes.hpp"

namespace adit {

// Owns its bytes, or views bytes of a received sample and keeps that sample alive, so that a received 4 MB cloud is
// never copied. Copying an owner copies the bytes; copying a view shares the sample. Writing (data(), resize) to a view
// first makes it an owner. Not synchronized: one thread at a time, like std::vector.
class Blob {
 public:
  Blob() = default;
  explicit Blob(std::size_t size) { resize(size); }
  Blob(std::initializer_list<std::uint8_t> bytes) { assign({bytes.begin(), bytes.size()}); }
  explicit Blob(std::span<const std::uint8_t> bytes) { assign(bytes); }
  Blob(const Blob& other);
  Blob(Blob&& other) noexcept;
  Blob& operator=(const Blob& other);
  Blob& operator=(Blob&& other) noexcept;
  ~Blob() = default;

  // Views `bytes`, which stay valid as long as `owner` is held.
  static Blob view(std::span<const std::uint8_t> bytes, KeepAlive owner);

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  bool is_view() const { return static_cast<bool>(owner_); }
  const std::uint8_t* data() const { return view_ ? view_ : storage_.get(); }
  const std::uint8_t* begin() const { return data(); }
  const std::uint8_t* end() const { return data() + size_; }
  std::uint8_t operator[](std::size_t index) const { return data()[index]; }
  std::span<const std::uint8_t> span() const { return {data(), size_}; }

  // Writable bytes; a view becomes an owner first (this is the one place that copies).
  std::uint8_t* mutable_data();
  // Keeps the common prefix; new bytes are NOT initialized (a frame is about to be written over them). Allocates only
  // when the size exceeds every earlier one.
  void resize(std::size_t size);
  // Copies `bytes` in; reuses the memory it has.
  void assign(std::span<const std::uint8_t> bytes);
  // Size 0; keeps owned memory for the next use, lets a viewed sample go.
  void clear();

  friend bool operator==(const Blob& a, const Blob& b);

 private:
  void become_owner(std::size_t capacity);

  std::unique_ptr<std::uint8_t[]> storage_;
  std::size_t capacity_ = 0;
  std::size_t size_ = 0;
  const std::uint8_t* view_ = nullptr;  // set while viewing
  KeepAlive owner_;
};

}  // namespace adit
