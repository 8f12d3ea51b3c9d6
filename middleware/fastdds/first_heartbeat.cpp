#include "middleware/fastdds/first_heartbeat.hpp"

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>

namespace adit::fastdds {
namespace {

// RTPS 2.2, 9.4: a header of 20 bytes, then submessages: id, flags (bit 0: little endian), length, content.
constexpr std::size_t header_bytes = 20, prefix_offset = 8, prefix_bytes = 12;
constexpr std::uint8_t acknack = 0x06, heartbeat = 0x07, info_destination = 0x0e;
constexpr std::uint8_t little_endian = 0x01, final = 0x02;
constexpr int most_answers = 3;  // a reader that still asks does not want to hear it

std::uint32_t number_at(const std::uint8_t* at, bool little) {
  const std::uint32_t b0 = at[0], b1 = at[1], b2 = at[2], b3 = at[3];
  return little ? b0 | b1 << 8 | b2 << 16 | b3 << 24 : b3 | b2 << 8 | b1 << 16 | b0 << 24;
}

void put(std::vector<std::uint8_t>& out, std::uint32_t number) {
  for (int shift = 0; shift < 32; shift += 8) out.push_back(static_cast<std::uint8_t>(number >> shift));
}

void put_sequence(std::vector<std::uint8_t>& out, std::uint64_t number) {
  put(out, static_cast<std::uint32_t>(number >> 32));
  put(out, static_cast<std::uint32_t>(number));
}

bool same_entity(const Gid& a, const Gid& b) {
  return std::equal(a.bytes.begin() + prefix_bytes, a.bytes.end(), b.bytes.begin() + prefix_bytes);
}

template <class Visit>
void for_each_submessage(std::span<const std::uint8_t> message, Visit visit) {
  if (message.size() < header_bytes || std::memcmp(message.data(), "RTPS", 4) != 0) return;
  for (auto rest = message.subspan(header_bytes); rest.size() >= 4;) {
    const bool little = rest[1] & little_endian;
    const std::size_t length = little ? rest[2] | rest[3] << 8 : rest[3] | rest[2] << 8;
    const std::uint8_t id = rest[0];
    rest = rest.subspan(4);
    if (length > rest.size()) return;
    visit(id, little, rest.first(length));
    if (length == 0) return;  // that is the last one (8.3.3.2.3)
    rest = rest.subspan(length);
  }
}

}  // namespace

std::vector<std::uint8_t> empty_heartbeat(const Gid& writer, const Gid& reader, std::uint64_t last) {
  const auto* const from = writer.bytes.data();
  const auto* const to = reader.bytes.data();
  std::vector<std::uint8_t> out = {'R', 'T', 'P', 'S', 2, 2, 0x01, 0x0f};
  out.insert(out.end(), from, from + prefix_bytes);
  out.insert(out.end(), {info_destination, little_endian, prefix_bytes, 0});
  out.insert(out.end(), to, to + prefix_bytes);
  out.insert(out.end(), {heartbeat, little_endian | final, 28, 0});
  out.insert(out.end(), to + prefix_bytes, to + 16);
  out.insert(out.end(), from + prefix_bytes, from + 16);
  put_sequence(out, last + 1);
  put_sequence(out, last);
  put(out, 0);  // before any count of the vendor's
  return out;
}

std::vector<AckNack> acknacks_in(std::span<const std::uint8_t> message) {
  std::vector<AckNack> found;
  for_each_submessage(message, [&](std::uint8_t id, bool little, std::span<const std::uint8_t> content) {
    if (id != acknack || content.size() < 20) return;
    AckNack one;
    std::copy_n(message.data() + prefix_offset, prefix_bytes, one.reader.bytes.begin());
    std::copy_n(content.data(), 4, one.reader.bytes.begin() + prefix_bytes);
    std::copy_n(content.data() + 4, 4, one.writer_entity.bytes.begin() + prefix_bytes);
    one.base = std::uint64_t{number_at(content.data() + 8, little)} << 32 | number_at(content.data() + 12, little);
    one.asks = number_at(content.data() + 16, little) > 0;
    found.push_back(one);
  });
  return found;
}

FirstHeartbeat::~FirstHeartbeat() {
  if (socket_ >= 0) close(socket_);
}

void FirstHeartbeat::expect(const Gid& writer, const Gid& reader, std::uint64_t last, const sockaddr_in& address) {
  const std::lock_guard lock(mutex_);
  if (socket_ < 0) socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  list_.push_back({writer, reader, last, address, 0});
  expected_ = list_.size();
}

template <class Condition>
void FirstHeartbeat::erase(Condition condition) {
  const std::lock_guard lock(mutex_);
  std::erase_if(list_, condition);
  expected_ = list_.size();
}

void FirstHeartbeat::forget(const Gid& writer, const Gid& reader) {
  erase([&](const Expected& e) { return e.writer == writer && e.reader == reader; });
}

void FirstHeartbeat::forget(const Gid& writer) {
  erase([&](const Expected& e) { return e.writer == writer; });
}

void FirstHeartbeat::send_to(const Expected& expected) const {
  const auto message = empty_heartbeat(expected.writer, expected.reader, expected.last);
  // A datagram that is lost here is asked for again.
  (void)sendto(socket_, message.data(), message.size(), 0, reinterpret_cast<const sockaddr*>(&expected.address),
               sizeof expected.address);
}

void FirstHeartbeat::answer(std::span<const std::uint8_t> message) {
  for (const AckNack& asked : acknacks_in(message)) {
    erase([&](Expected& expected) {
      if (expected.reader != asked.reader || !same_entity(expected.writer, asked.writer_entity)) return false;
      if (asked.asks || asked.base > expected.last + 1) return true;  // it has heard ours, and one of the vendor's
      if (expected.answers++ < most_answers) send_to(expected);
      return false;
    });
  }
}

void FirstHeartbeat::precede(std::span<const std::uint8_t> message) {
  for_each_submessage(message, [&](std::uint8_t id, bool, std::span<const std::uint8_t> content) {
    if (id != heartbeat || content.size() < 8) return;
    Gid writer_entity;
    std::copy_n(content.data() + 4, 4, writer_entity.bytes.begin() + prefix_bytes);
    const std::lock_guard lock(mutex_);
    for (const Expected& expected : list_) {
      if (same_entity(expected.writer, writer_entity)) send_to(expected);
    }
  });
}

}  // namespace adit::fastdds
