#include "middleware/fastdds/late_announcement.hpp"

#include <fastdds/rtps/network/SenderResource.h>
#include <fastrtps/utils/IPLocator.h>

#include <algorithm>

#include <fastdds/rtps/common/LocatorList.hpp>

#include "middleware/fastdds/listening_ports.hpp"

namespace adit::fastdds {
namespace {

namespace transport = eprosima::fastdds::rtps;
namespace rtps = eprosima::fastrtps::rtps;

// What is sent to more destinations than this is an announcement.
constexpr std::size_t most_readers_at_once = 16;

bool may_be_heard(const rtps::Locator_t& locator, const std::vector<std::uint16_t>& listening) {
  if (locator.kind != LOCATOR_KIND_UDPv4 || locator.address[12] != 127) return true;
  return std::binary_search(listening.begin(), listening.end(), rtps::IPLocator::getPhysicalPort(locator));
}

class Transport final : public transport::ChainingTransport {
 public:
  Transport(const LateAnnouncement& descriptor, LateAnnouncement::Audible audible,
            std::shared_ptr<FirstHeartbeat> first_heartbeat)
      : ChainingTransport(descriptor),
        descriptor_(descriptor),
        audible_(std::move(audible)),
        first_heartbeat_(std::move(first_heartbeat)) {}

  transport::TransportDescriptorInterface* get_configuration() override { return &descriptor_; }

  bool send(rtps::SenderResource* sender, const rtps::octet* message, std::uint32_t size, rtps::LocatorsIterator* first,
            rtps::LocatorsIterator* last, const std::chrono::steady_clock::time_point& timeout) override {
    if (!audible_->load(std::memory_order_relaxed)) return true;
    if (first_heartbeat_) first_heartbeat_->sending({message, size});
    if (const auto* begin = dynamic_cast<const rtps::Locators*>(first)) {
      if (const auto heard = who_can_hear(*begin, *last); !heard.empty()) {
        rtps::Locators heard_first(heard.begin()), heard_last(heard.end());
        return sender->send(message, size, &heard_first, &heard_last, timeout);
      }
    }
    return sender->send(message, size, first, last, timeout);
  }
  void receive(transport::TransportReceiverInterface* next, const rtps::octet* message, std::uint32_t size,
               const rtps::Locator_t& local, const rtps::Locator_t& remote) override {
    if (first_heartbeat_) first_heartbeat_->received({message, size});
    next->OnDataReceived(message, size, local, remote);
  }

 private:
  // Empty when all are to be told.
  static rtps::LocatorList_t who_can_hear(const rtps::Locators& first, const rtps::LocatorsIterator& last) {
    rtps::LocatorList_t heard;
    std::size_t count = 0;
    for (rtps::Locators it = first; it != last; ++it) ++count;
    if (count <= most_readers_at_once) return heard;
    const std::vector<std::uint16_t> listening = listening_loopback_ports();
    if (listening.empty()) return heard;
    for (rtps::Locators it = first; it != last; ++it) {
      if (may_be_heard(*it, listening)) heard.push_back(*it);
    }
    return heard;
  }

  LateAnnouncement descriptor_;
  const LateAnnouncement::Audible audible_;
  const std::shared_ptr<FirstHeartbeat> first_heartbeat_;
};

}  // namespace

transport::TransportInterface* LateAnnouncement::create_transport() const {
  return new Transport(*this, audible_, first_heartbeat_);
}

}  // namespace adit::fastdds
