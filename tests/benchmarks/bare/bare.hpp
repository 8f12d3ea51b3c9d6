// Programs on the vendors' own APIs, without anything of ours but the configuration: what the seam is measured against.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

namespace adit::bench {

// One publishing side. send() stamps the message with CLOCK_MONOTONIC as the last thing before it publishes it.
class Sender {
 public:
  virtual ~Sender() = default;
  virtual bool matched() const = 0;
  virtual bool send() = 0;
};

// Calls back for each message, with its stamp, until it is destroyed.
class Receiver {
 public:
  virtual ~Receiver() = default;
};
using OnMessage = std::function<void(std::int64_t sent_ns)>;

// In whose thread a bare receiver takes: its own, woken by the vendor's wait set (as our executor is), or the vendor's,
// in the listener's callback.
enum class TakeIn { own_thread, vendor_thread };

std::int64_t monotonic_ns();

// Null when the vendor refuses.
std::unique_ptr<Sender> make_bare_cyclonedds_sender(std::uint32_t domain, std::size_t bytes);
std::unique_ptr<Receiver> make_bare_cyclonedds_receiver(std::uint32_t domain, std::size_t bytes, TakeIn take_in,
                                                        OnMessage on_message);
std::unique_ptr<Sender> make_bare_fastdds_sender(std::uint32_t domain, std::size_t bytes);
std::unique_ptr<Receiver> make_bare_fastdds_receiver(std::uint32_t domain, std::size_t bytes, TakeIn take_in,
                                                     OnMessage on_message);

}  // namespace adit::bench
