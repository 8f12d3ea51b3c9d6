// CDR (XCDR1) of generated messages on Fast CDR. Included by the generated .cpp files only: nothing else of the project
// sees Fast CDR. Three walks over the fields of a message: Sizer, CdrWriter, CdrReader.
//
// Fast CDR writes and reads the values (and swaps bytes). What it leaves open is done here: padding is written as
// zeros, every length is checked against the rest of the payload before memory is touched, nothing throws.
#pragma once

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <new>
#include <string>
#include <vector>

#include "idl/blob.hpp"
#include "idl/bounded.hpp"
#include "idl/codec.hpp"

namespace adit::cdr {

inline constexpr std::size_t encapsulation_size = 4;

template <class T>
concept Primitive = std::is_arithmetic_v<T>;

// Bytes from `offset` to the next multiple of `size`, a power of two.
constexpr std::size_t padding(std::size_t offset, std::size_t size) {
  return (0 - offset) & (size - 1);
}

// Serialized bytes that no T falls below: what a sequence's length is checked with.
template <class T>
constexpr std::size_t minimum_size() {
  if constexpr (Primitive<T>) {
    return sizeof(T);
  } else if constexpr (Message<T>) {
    return minimum_encoded_size(std::type_identity<T>{});
  } else {
    return sizeof(std::uint32_t);  // a string: its length
  }
}

class Sizer {
 public:
  std::size_t size() const { return offset_; }

  template <class T>
  void operator()(const char*, const T& value) {
    add(value);
  }

  template <Message T>
  void add(const T& message) {
    for_each_field(message, *this);
  }
  template <Primitive T>
  void add(T) {
    add_array<T>(1);
  }
  void add(const std::string& text) { add_length(), offset_ += text.size() + 1; }
  void add(const Blob& blob) { add_length(), offset_ += blob.size(); }
  void add(const std::vector<bool>& values) { add_length(), offset_ += values.size(); }
  template <class T, std::size_t N>
  void add(const std::array<T, N>& values) {
    add_elements<T>(values);
  }
  template <class T>
  void add(const std::vector<T>& values) {
    add_length();
    add_elements<T>(values);
  }

 private:
  void add_length() { add_array<std::uint32_t>(1); }
  template <class T>
  void add_array(std::size_t count) {
    if (count > 0) offset_ += padding(offset_, sizeof(T)) + count * sizeof(T);
  }
  template <class T>
  void add_elements(const auto& values) {
    if constexpr (Primitive<T>) {
      add_array<T>(values.size());
    } else {
      for (const T& value : values) add(value);
    }
  }

  std::size_t offset_ = 0;
};

// Precondition: `body` holds what Sizer counted.
class CdrWriter {
 public:
  explicit CdrWriter(MutableBytes body)
      : body_(body.data()),
        buffer_(reinterpret_cast<char*>(body.data()), body.size()),
        cdr_(buffer_, eprosima::fastcdr::Cdr::LITTLE_ENDIANNESS, eprosima::fastcdr::Cdr::DDS_CDR) {}

  bool ok() const { return ok_; }
  std::size_t size() const { return offset_; }

  template <class T>
  void operator()(const char*, const T& value) {
    put(value);
  }

  template <Message T>
  void put(const T& message) {
    for_each_field(message, *this);
  }
  template <Primitive T>
  void put(T value) {
    pad(sizeof(T));
    cdr_ << value;
    offset_ += sizeof(T);
  }
  void put(const std::string& text) {
    put_length(text.size() + 1);
    put_array(text.c_str(), text.size() + 1);
  }
  template <std::size_t N>
  void put(const BoundedString<N>& text) {
    ok_ = ok_ && text.size() <= N;
    put(static_cast<const std::string&>(text));
  }
  void put(const Blob& blob) {
    put_length(blob.size());
    put_array(blob.data(), blob.size());
  }
  void put(const std::vector<bool>& values) {
    put_length(values.size());
    for (const bool value : values) put(value);
  }
  template <class T, std::size_t N>
  void put(const std::array<T, N>& values) {
    put_elements<T>(values);
  }
  template <class T>
  void put(const std::vector<T>& values) {
    put_length(values.size());
    put_elements<T>(values);
  }
  template <class T, std::size_t N>
  void put(const BoundedVector<T, N>& values) {
    ok_ = ok_ && values.size() <= N;
    put(static_cast<const std::vector<T>&>(values));
  }

 private:
  void pad(std::size_t size) {
    const std::size_t gap = padding(offset_, size);
    if (gap == 0) return;
    std::memset(body_ + offset_, 0, gap);
    cdr_.jump(gap);
    offset_ += gap;
  }
  void put_length(std::size_t length) {
    ok_ = ok_ && length <= std::numeric_limits<std::uint32_t>::max();
    put(static_cast<std::uint32_t>(length));
  }
  template <class T>
  void put_array(const T* values, std::size_t count) {
    if (count == 0) return;
    pad(sizeof(T));
    cdr_.serializeArray(values, count);
    offset_ += count * sizeof(T);
  }
  template <class T>
  void put_elements(const auto& values) {
    if constexpr (Primitive<T>) {
      put_array(values.data(), values.size());
    } else {
      for (const T& value : values) put(value);
    }
  }

  std::byte* body_;
  eprosima::fastcdr::FastBuffer buffer_;
  eprosima::fastcdr::Cdr cdr_;
  std::size_t offset_ = 0;
  bool ok_ = true;
};

// Reads until the first fault; the status says which.
class CdrReader {
 public:
  CdrReader(Bytes body, bool little_endian, const KeepAlive& keep_alive)
      : body_(body),
        keep_alive_(keep_alive),
        // Fast CDR takes writable memory even to read; nothing writes to it.
        buffer_(reinterpret_cast<char*>(const_cast<std::byte*>(body.data())), body.size()),
        cdr_(buffer_,
             little_endian ? eprosima::fastcdr::Cdr::LITTLE_ENDIANNESS : eprosima::fastcdr::Cdr::BIG_ENDIANNESS,
             eprosima::fastcdr::Cdr::DDS_CDR) {}

  DecodeStatus status() const { return status_; }

  template <class T>
  void operator()(const char*, T& value) {
    if (ok()) get(value);
  }

  template <Message T>
  void get(T& message) {
    for_each_field(message, *this);
  }
  template <Primitive T>
  void get(T& value) {
    if (align_and_check<T>(1)) {
      cdr_ >> value;
      offset_ += sizeof(T);
    }
  }
  void get(bool& value) {
    std::uint8_t byte = 0;
    get(byte);
    if (byte > 1) fail(DecodeStatus::bad_boolean);
    value = byte == 1;
  }
  void get(std::string& text) {
    const std::size_t length = get_length(1);
    const char* const from = reinterpret_cast<const char*>(body_.data()) + offset_;
    if (length == 0) return text.clear();  // written by some implementations for an empty string
    if (from[length - 1] != '\0') return fail(DecodeStatus::unterminated_string);
    text.assign(from, length - 1);
    skip(length);
  }
  template <std::size_t N>
  void get(BoundedString<N>& text) {
    get(static_cast<std::string&>(text));
    if (text.size() > N) fail(DecodeStatus::bound_exceeded);
  }
  void get(Blob& blob) {
    const std::size_t length = get_length(1);
    const std::span<const std::uint8_t> bytes(reinterpret_cast<const std::uint8_t*>(body_.data()) + offset_, length);
    if (keep_alive_) {
      blob = Blob::view(bytes, keep_alive_);
    } else {
      blob.assign(bytes);
    }
    skip(length);
  }
  void get(std::vector<bool>& values) {
    values.resize(get_length(1));
    for (std::size_t i = 0; i < values.size() && ok(); ++i) {
      bool value = false;
      get(value);
      values[i] = value;
    }
  }
  template <class T, std::size_t N>
  void get(std::array<T, N>& values) {
    get_elements<T>(values);
  }
  template <class T>
  void get(std::vector<T>& values) {
    values.resize(get_length(minimum_size<T>()));
    get_elements<T>(values);
  }
  template <class T, std::size_t N>
  void get(BoundedVector<T, N>& values) {
    const std::size_t length = get_length(minimum_size<T>());
    if (length > N) return fail(DecodeStatus::bound_exceeded);
    values.resize(length);
    get_elements<T>(values);
  }

 private:
  bool ok() const { return status_ == DecodeStatus::ok; }
  std::size_t remaining() const { return body_.size() - offset_; }
  void fail(DecodeStatus status) {
    if (ok()) status_ = status;
  }
  void skip(std::size_t size) {
    if (size > 0) cdr_.jump(size);
    offset_ += size;
  }
  template <class T>
  bool align_and_check(std::size_t count) {
    const std::size_t gap = padding(offset_, sizeof(T));
    if (gap > remaining() || count > (remaining() - gap) / sizeof(T)) {
      fail(DecodeStatus::truncated);
      return false;
    }
    skip(gap);
    return true;
  }
  // A length that the rest of the payload can hold; otherwise 0 and a status.
  std::size_t get_length(std::size_t minimum_element_size) {
    std::uint32_t length = 0;
    get(length);
    if (length <= remaining() / minimum_element_size) return length;
    fail(DecodeStatus::length_exceeds_payload);
    return 0;
  }
  template <class T>
  void get_elements(auto& values) {
    if constexpr (Primitive<T> && !std::is_same_v<T, bool>) {
      if (values.empty() || !align_and_check<T>(values.size())) return;
      cdr_.deserializeArray(values.data(), values.size());
      offset_ += values.size() * sizeof(T);
    } else {
      for (T& value : values) {
        if (!ok()) return;
        get(value);
      }
    }
  }

  Bytes body_;
  const KeepAlive& keep_alive_;
  eprosima::fastcdr::FastBuffer buffer_;
  eprosima::fastcdr::Cdr cdr_;
  std::size_t offset_ = 0;
  DecodeStatus status_ = DecodeStatus::ok;
};

template <Message T>
std::size_t encoded_size(const T& message) {
  Sizer sizer;
  sizer.add(message);
  return encapsulation_size + sizer.size();
}

template <Message T>
std::size_t encode(const T& message, MutableBytes out) {
  const std::size_t size = cdr::encoded_size(message);
  if (out.size() < size) return 0;
  constexpr std::array<std::byte, encapsulation_size> cdr_le = {std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}};
  std::memcpy(out.data(), cdr_le.data(), cdr_le.size());
  CdrWriter writer(out.subspan(encapsulation_size, size - encapsulation_size));
  writer.put(message);
  return writer.ok() ? size : 0;
}

template <Message T>
DecodeStatus decode(Bytes payload, T& out, const KeepAlive& keep_alive) {
  if (payload.size() < encapsulation_size) return DecodeStatus::truncated;
  // CDR_BE 00 00, CDR_LE 00 01 (RTPS 2.5, 10.2); the two option bytes carry nothing for plain CDR.
  if (payload[0] != std::byte{0} || payload[1] > std::byte{1}) return DecodeStatus::bad_encapsulation;
  try {
    CdrReader reader(payload.subspan(encapsulation_size), payload[1] == std::byte{1}, keep_alive);
    reader.get(out);
    return reader.status();
  } catch (const std::bad_alloc&) {
    return DecodeStatus::out_of_memory;
  } catch (const std::exception&) {
    return DecodeStatus::truncated;  // Fast CDR's own bounds check; ours comes first
  }
}

}  // namespace adit::cdr
