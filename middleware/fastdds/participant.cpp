// The module's participant and its entry point.
#include <fastrtps/config.h>

#include "middleware/fastdds/reader.hpp"
#include "middleware/fastdds/writer.hpp"
#include "middleware/vendor.hpp"

namespace adit::fastdds {
namespace {

Result<void> check_endpoint(const EndpointConfig& config) {
  if (config.topic.empty()) return Error{ErrorCode::invalid_argument, "an endpoint needs a topic name"};
  if (!config.type || config.type->dds_name.empty()) {
    return Error{ErrorCode::invalid_argument, "endpoint of '" + config.topic + "' needs a type with a DDS name"};
  }
  return validate(config.qos);
}

class FastParticipant final : public Participant {
 public:
  explicit FastParticipant(std::shared_ptr<VendorParticipant> vendor) : vendor_(std::move(vendor)) {}
  ~FastParticipant() override { vendor_->events().set_handler(nullptr); }

  Result<std::unique_ptr<Writer>> writer(const EndpointConfig& config) override {
    if (auto valid = check_endpoint(config); !valid) return valid.error();
    return FastWriter::create(vendor_, config);
  }
  Result<std::unique_ptr<Reader>> reader(const EndpointConfig& config) override {
    if (auto valid = check_endpoint(config); !valid) return valid.error();
    const auto created = LoaningReader::create(vendor_, config);
    if (!created) return created.error();
    return std::unique_ptr<Reader>(std::make_unique<FastReader>(*created));
  }
  Graph graph() const override { return vendor_->graph(); }
  void on_event(EventHandler handler) override { vendor_->events().set_handler(std::move(handler)); }
  std::string explain() const override { return vendor_->explain(); }
  const ParticipantConfig& config() const override { return vendor_->config(); }
  Gid gid() const override { return vendor_->gid(); }

 private:
  std::shared_ptr<VendorParticipant> vendor_;
};

Result<std::unique_ptr<Participant>> open_participant(const ParticipantConfig& config, std::string_view user_data) {
  auto vendor = VendorParticipant::open(config, user_data);
  if (!vendor) return vendor.error();
  return std::unique_ptr<Participant>(std::make_unique<FastParticipant>(*std::move(vendor)));
}

constexpr VendorModule module{"fastdds", FASTRTPS_VERSION_STR, &open_participant};

}  // namespace
}  // namespace adit::fastdds

extern "C" const adit::VendorModule* ADIT_VENDOR_ENTRY_POINT() {
  return &adit::fastdds::module;
}
