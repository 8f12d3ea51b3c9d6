// A UDP transport that stays silent until the participant can hear the answers.
#pragma once

#include <fastdds/rtps/transport/ChainingTransport.h>

#include <atomic>
#include <memory>

namespace adit::fastdds {

// The vendor announces a new participant from within its creation, before its receivers are connected: whoever answers
// at once (Fast DDS does, once) is not heard, and both wait for the next announcement of a period of seconds. This
// transport drops what is sent until `audible` is set, which is done when creation has returned; the announcements that
// follow find everybody.
class LateAnnouncement final : public eprosima::fastdds::rtps::ChainingTransportDescriptor {
 public:
  using Audible = std::shared_ptr<std::atomic<bool>>;
  LateAnnouncement(std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> udp, Audible audible)
      : ChainingTransportDescriptor(std::move(udp)), audible_(std::move(audible)) {}
  eprosima::fastdds::rtps::TransportInterface* create_transport() const override;

 private:
  Audible audible_;
};

}  // namespace adit::fastdds
