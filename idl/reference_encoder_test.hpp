// A second, plain CDR writer for tests: either byte order, any filling of the padding. Shares no code with
// cdr_codec.hpp.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <vector>

#include "idl/blob.hpp"
#include "idl/codec.hpp"

namespace adit {

class ReferenceEncoder {
 public:
  explicit ReferenceEncoder(bool bigendian, std::uint8_t padding = 0) : bigendian_(bigendian), padding_(padding) {
    for (const int byte : {0, bigendian ? 0 : 1, 0, 0}) bytes_.push_back(std::byte(byte));
  }
  template <Message T>
  std::vector<std::byte> operator()(const T& message) {
    put(message);
    return bytes_;
  }
  template <class T>
  void operator()(const char*, const T& value) {
    put(value);
  }

 private:
  template <Message T>
  void put(const T& message) {
    for_each_field(message, *this);
  }
  template <class T>
  requires std::is_arithmetic_v<T>
  void put(T value) {
    while ((bytes_.size() - 4) % sizeof(T) != 0) bytes_.push_back(std::byte{padding_});
    std::array<std::byte, sizeof(T)> raw;
    std::memcpy(raw.data(), &value, sizeof(T));
    if (bigendian_) std::reverse(raw.begin(), raw.end());
    bytes_.insert(bytes_.end(), raw.begin(), raw.end());
  }
  void put(const std::string& text) {
    put(static_cast<std::uint32_t>(text.size() + 1));
    for (const char c : text) put(c);
    put('\0');
  }
  void put(const Blob& blob) {
    put(static_cast<std::uint32_t>(blob.size()));
    for (const std::uint8_t byte : blob) put(byte);
  }
  template <class T, std::size_t N>
  void put(const std::array<T, N>& values) {
    for (const T& value : values) put(value);
  }
  template <class T>
  void put(const std::vector<T>& values) {
    put(static_cast<std::uint32_t>(values.size()));
    for (const T& value : values) put(value);
  }

  bool bigendian_;
  std::uint8_t padding_;
  std::vector<std::byte> bytes_;
};

}  // namespace adit
