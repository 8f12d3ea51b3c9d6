#include "idl/blob.hpp"

#include <algorithm>
#include <cstring>

namespace adit {

Blob::Blob(const Blob& other) {
  *this = other;
}

Blob::Blob(Blob&& other) noexcept {
  *this = std::move(other);
}

Blob& Blob::operator=(const Blob& other) {
  if (this == &other) return *this;
  if (other.is_view()) {
    view_ = other.view_;
    size_ = other.size_;
    owner_ = other.owner_;
  } else {
    assign(other.span());
  }
  return *this;
}

Blob& Blob::operator=(Blob&& other) noexcept {
  if (this == &other) return *this;
  // Swapping the storage lets both sides go on using the memory they have grown.
  std::swap(storage_, other.storage_);
  std::swap(capacity_, other.capacity_);
  size_ = std::exchange(other.size_, 0);
  view_ = std::exchange(other.view_, nullptr);
  owner_ = std::move(other.owner_);
  return *this;
}

Blob Blob::view(std::span<const std::uint8_t> bytes, KeepAlive owner) {
  Blob blob;
  blob.view_ = bytes.data();
  blob.size_ = bytes.size();
  blob.owner_ = std::move(owner);
  return blob;
}

std::uint8_t* Blob::mutable_data() {
  if (view_) become_owner(size_);
  return storage_.get();
}

void Blob::resize(std::size_t size) {
  if (view_ || size > capacity_) become_owner(size);
  size_ = size;
}

void Blob::assign(std::span<const std::uint8_t> bytes) {
  clear();
  resize(bytes.size());
  if (!bytes.empty()) std::memcpy(storage_.get(), bytes.data(), bytes.size());
}

void Blob::clear() {
  size_ = 0;
  view_ = nullptr;
  owner_ = {};
}

bool operator==(const Blob& a, const Blob& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end());
}

void Blob::become_owner(std::size_t capacity) {
  const std::size_t kept = std::min(size_, capacity);
  const std::uint8_t* const from = data();
  if (capacity > capacity_) {
    std::unique_ptr<std::uint8_t[]> larger(new std::uint8_t[capacity]);
    if (kept > 0) std::memcpy(larger.get(), from, kept);
    storage_ = std::move(larger);
    capacity_ = capacity;
  } else if (view_ && kept > 0) {
    std::memcpy(storage_.get(), from, kept);
  }
  view_ = nullptr;
  owner_ = {};
}

}  // namespace adit
