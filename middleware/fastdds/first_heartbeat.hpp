// The heartbeat that Fast DDS does not send to a reader it has nothing for yet.
#pragma once

#include <netinet/in.h>

#include <atomic>
#include <mutex>
#include <span>
#include <vector>

#include "middleware/sample.hpp"

namespace adit::fastdds {

// A volatile Cyclone DDS reader takes all that the first heartbeat of a writer announces as history that is not for it.
// Fast DDS sends none while a writer's history is empty (2.9), so that its first one announces samples written after
// the match: what of them had not arrived whole by then would be lost, and nobody would know. Therefore such a reader
// gets a heartbeat from here first: HEARTBEAT, the samples up to the match are gone and there are no others. It is the
// answer to the reader's first question (the pre-emptive ACKNACK of RTPS 2.2, 8.4.2.3.4), and it precedes every
// heartbeat of the vendor until the reader shows that it heard. From then on the reader asks for what it misses.
//
// Thread-safe. One a participant.
class FirstHeartbeat {
 public:
  FirstHeartbeat() = default;
  ~FirstHeartbeat();
  FirstHeartbeat(const FirstHeartbeat&) = delete;
  FirstHeartbeat& operator=(const FirstHeartbeat&) = delete;

  // `writer`, ours, matched `reader`, which receives at `address`; `last` is the newest sample that is not for it.
  void expect(const Gid& writer, const Gid& reader, std::uint64_t last, const sockaddr_in& address);
  void forget(const Gid& writer, const Gid& reader);
  void forget(const Gid& writer);

  // Every RTPS message that arrives, before the vendor sees it, and every one it sends, before it goes.
  void received(std::span<const std::uint8_t> message) {
    if (expected_.load(std::memory_order_relaxed) > 0) answer(message);
  }
  void sending(std::span<const std::uint8_t> message) {
    if (expected_.load(std::memory_order_relaxed) > 0) precede(message);
  }

 private:
  struct Expected {
    Gid writer, reader;
    std::uint64_t last = 0;
    sockaddr_in address{};
    int answers = 0;
  };
  void answer(std::span<const std::uint8_t> message);
  void precede(std::span<const std::uint8_t> message);
  void send_to(const Expected& expected) const;
  template <class Condition>
  void erase(Condition condition);

  std::atomic<std::size_t> expected_{0};
  std::mutex mutex_;  // guards the two below; a leaf
  std::vector<Expected> list_;
  int socket_ = -1;
};

// An RTPS message with a HEARTBEAT from `writer` to `reader`: no sample there, the next one is last + 1.
std::vector<std::uint8_t> empty_heartbeat(const Gid& writer, const Gid& reader, std::uint64_t last);

// The ACKNACK submessages of an RTPS message.
struct AckNack {
  Gid writer_entity, reader;  // of the writer only the entity id
  std::uint64_t base = 0;     // all before are acknowledged
  bool asks = false;          // for any sample
};
std::vector<AckNack> acknacks_in(std::span<const std::uint8_t> message);

}  // namespace adit::fastdds
