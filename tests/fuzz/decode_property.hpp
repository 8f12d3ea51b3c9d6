// What must hold for any bytes that a decoder is given; shared by the libFuzzer targets and the unit suite's mutations.
#pragma once

#include <string>

#include "idl/type_registry.hpp"

namespace adit::test {

// Decodes `payload` as `type`. When that succeeds, the message encodes, and what was encoded decodes to the same again;
// clouds and thermal frames are then read through their views. Returns what does not hold; empty when all is well.
std::string check_decode(const MessageType& type, Bytes payload);

// Memory that decoding and encoding again may allocate for a payload: the largest ratio of a C++ object to its smallest
// serialized form is about 12 (a Blob for a 4-byte length), and the message exists up to three times.
constexpr std::size_t allocation_limit(std::size_t payload_size) {
  return 4096 + 40 * payload_size;
}

}  // namespace adit::test
