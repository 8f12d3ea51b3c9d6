#pragma once

#include <memory>

#include "components/runtime/component.hpp"
#include "components/runtime/log_sink.hpp"
#include "rcl_interfaces/msg/log.hpp"

namespace adit {

// Mirrors the logs of the process to /rosout, away from the threads that log.
class RosoutPublisher final : public Component {
 public:
  explicit RosoutPublisher(std::shared_ptr<LogSink> sink);
  ~RosoutPublisher() override;

 private:
  Result<void> activate() override;
  Result<void> deactivate() override;
  void publish();

  std::shared_ptr<LogSink> sink_;
  std::uint64_t reported_drops_ = 0;
  Output<rcl_interfaces::msg::Log> rosout_{*this, "/rosout", Qos::rosout()};
  Trigger logged_{*this, [this] { publish(); }};
};

}  // namespace adit
