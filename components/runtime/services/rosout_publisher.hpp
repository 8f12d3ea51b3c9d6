#pragma once

#include <memory>

#include "components/runtime/component.hpp"
#include "components/runtime/log_sink.hpp"
#include "rcl_interfaces/msg/log.hpp"

namespace adit {

// Mirrors the logs of the process to /rosout, ten times a second, away from the threads that log.
class RosoutPublisher final : public Component {
 public:
  explicit RosoutPublisher(std::shared_ptr<LogSink> sink) : sink_(std::move(sink)) { sink_->keep_records(256); }

 private:
  Result<void> deactivate() override;
  void publish();

  std::shared_ptr<LogSink> sink_;
  std::uint64_t reported_drops_ = 0;
  Output<rcl_interfaces::msg::Log> rosout_{*this, "/rosout", Qos::rosout()};
  Timer timer_{*this, "publish", std::chrono::milliseconds(100), [this] { publish(); }};
};

}  // namespace adit
