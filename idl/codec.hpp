// Encode and decode any generated message: CDR (XCDR1), the format of DDS samples and of ROS 2 bags.
// Declared here for every message; defined once a type in the generated sources, so that including this costs nothing.
#pragma once

#include <concepts>
#include <cstddef>
#include <string_view>
#include <type_traits>

#include "idl/bytes.hpp"
#include "idl/type_info.hpp"

namespace adit {

// A struct generated from an .idl file.
template <class T>
concept Message = requires {
  { minimum_encoded_size(std::type_identity<T>{}) } -> std::same_as<std::size_t>;
};

enum class DecodeStatus {
  ok,
  truncated,               // the payload ends inside a field
  length_exceeds_payload,  // a string or sequence announces more than the payload still holds
  bad_encapsulation,       // the first four bytes are not those of CDR_BE or CDR_LE
  unterminated_string,     // a string does not end with NUL
  bad_boolean,             // a boolean is neither 0 nor 1
  bound_exceeded,          // a bounded sequence or string is longer than its type allows
  out_of_memory,
};
std::string_view to_string(DecodeStatus status);

template <Message T>
const TypeInfo& type_info();

// Exact bytes of the encoded message, the 4-byte encapsulation header included.
template <Message T>
std::size_t encoded_size(const T& message);

// Writes the message into `out` as little-endian CDR; padding bytes are zero. Returns the bytes written, or 0 when
// `out` is too small or the message holds what its type cannot (a sequence or string beyond its bound or beyond 2^32
// elements).
template <Message T>
std::size_t encode(const T& message, MutableBytes out);

// Reads `payload`, of either endianness, trailing bytes ignored. Never throws, never reads outside the payload, never
// allocates more than a small multiple of it. The memory of `out` is reused: no allocation once it has grown. With a
// `keep_alive` the Blobs of `out` view the payload and hold it, without one they copy. On failure `out` is a valid
// message of unspecified content.
template <Message T>
DecodeStatus decode(Bytes payload, T& out, const KeepAlive& keep_alive = {});

// Hands a message to the middleware. Refers to the message, which must neither change nor go away meanwhile.
template <Message T>
class MessageEncoder final : public Encoder {
 public:
  explicit MessageEncoder(const T& message) : message_(message), size_(encoded_size(message)) {}
  std::size_t size() const override { return size_; }
  std::size_t write(MutableBytes out) const override { return out.size() < size_ ? 0 : encode(message_, out); }

 private:
  const T& message_;
  std::size_t size_;
};

}  // namespace adit
