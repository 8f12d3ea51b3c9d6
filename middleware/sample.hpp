#pragma once

#include <algorithm>
#include <array>
#include <compare>
#include <cstdint>
#include <string>
#include <utility>

#include "idl/bytes.hpp"
#include "middleware/time.hpp"

namespace adit {

// A DDS GUID: prefix (12 bytes, names the participant; the first two are the vendor) and entity id (4), network order.
struct Gid {
  std::array<std::uint8_t, 16> bytes{};
  // The participant this endpoint belongs to.
  bool same_participant(const Gid& other) const {
    return std::equal(bytes.begin(), bytes.begin() + 12, other.bytes.begin());
  }
  friend auto operator<=>(const Gid&, const Gid&) = default;
};
std::string to_string(const Gid& gid);  // "01101d1a.733cfdda.a149438c.00002504"

struct MessageInfo {
  Time source_time{};    // the writer's clock when it published
  Time received_time{};  // this host's system clock when the sample arrived
  Gid writer;
  std::uint64_t sequence = 0;  // the writer's counter, 1 for its first sample; 0 when the vendor does not tell
};

// A received serialized sample: encapsulation header, then the data, then up to 3 bytes of padding. Holds the vendor's
// memory until it is destroyed or reset; a reader has a limited number of outstanding samples. Move-only; may be moved
// to and destroyed on any thread.
class Sample {
 public:
  Sample() = default;
  Sample(Bytes bytes, const MessageInfo& info, KeepAlive memory)
      : bytes_(bytes), info_(info), memory_(std::move(memory)) {}
  Sample(const Sample&) = delete;
  Sample& operator=(const Sample&) = delete;
  Sample(Sample&&) = default;
  Sample& operator=(Sample&&) = default;

  Bytes bytes() const { return bytes_; }
  const MessageInfo& info() const { return info_; }
  // What a Blob holds on to when it views this sample.
  const KeepAlive& memory() const { return memory_; }
  void reset() { *this = Sample(); }

 private:
  Bytes bytes_;
  MessageInfo info_;
  KeepAlive memory_;
};

}  // namespace adit
