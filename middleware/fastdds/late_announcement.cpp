#include "middleware/fastdds/late_announcement.hpp"

#include <fastdds/rtps/network/SenderResource.h>

namespace adit::fastdds {
namespace {

namespace transport = eprosima::fastdds::rtps;
namespace rtps = eprosima::fastrtps::rtps;

class Transport final : public transport::ChainingTransport {
 public:
  Transport(const LateAnnouncement& descriptor, LateAnnouncement::Audible audible)
      : ChainingTransport(descriptor), descriptor_(descriptor), audible_(std::move(audible)) {}

  transport::TransportDescriptorInterface* get_configuration() override { return &descriptor_; }

  bool send(rtps::SenderResource* sender, const rtps::octet* message, std::uint32_t size, rtps::LocatorsIterator* first,
            rtps::LocatorsIterator* last, const std::chrono::steady_clock::time_point& timeout) override {
    if (!audible_->load(std::memory_order_relaxed)) return true;
    return sender->send(message, size, first, last, timeout);
  }
  void receive(transport::TransportReceiverInterface* next, const rtps::octet* message, std::uint32_t size,
               const rtps::Locator_t& local, const rtps::Locator_t& remote) override {
    next->OnDataReceived(message, size, local, remote);
  }

 private:
  LateAnnouncement descriptor_;
  const LateAnnouncement::Audible audible_;
};

}  // namespace

transport::TransportInterface* LateAnnouncement::create_transport() const {
  return new Transport(*this, audible_);
}

}  // namespace adit::fastdds
