// A UDP transport that announces a participant when it can hear the answers, and only to those who listen.
#pragma once

#include <fastdds/rtps/transport/ChainingTransport.h>

#include <atomic>
#include <memory>

#include "middleware/fastdds/first_heartbeat.hpp"

namespace adit::fastdds {

// The vendor announces a new participant from within its creation, before its receivers are connected: whoever answers
// at once (Fast DDS does, once) is not heard, and both wait for the next announcement of a period of seconds. This
// transport drops what is sent until `audible` is set, which is done when creation has returned; the announcements that
// follow find everybody.
//
// Participants are looked for at the ports of all participant ids. On loopback the kernel knows at which of them
// anybody listens: the others, nearly all, are left out, which saves 0.6 ms of system time each announcement. Who comes
// later announces itself to us.
class LateAnnouncement final : public eprosima::fastdds::rtps::ChainingTransportDescriptor {
 public:
  using Audible = std::shared_ptr<std::atomic<bool>>;
  LateAnnouncement(std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> udp, Audible audible,
                   std::shared_ptr<FirstHeartbeat> first_heartbeat)
      : ChainingTransportDescriptor(std::move(udp)),
        audible_(std::move(audible)),
        first_heartbeat_(std::move(first_heartbeat)) {}
  eprosima::fastdds::rtps::TransportInterface* create_transport() const override;

 private:
  Audible audible_;
  std::shared_ptr<FirstHeartbeat> first_heartbeat_;  // sees what passes; null: nobody
};

}  // namespace adit::fastdds
