#include "components/runtime/services/rosout_publisher.hpp"

#include "components/runtime/stamp.hpp"

namespace adit {
namespace {

// The levels of rcl_interfaces/msg/Log.
std::uint8_t to_ros(LogLevel level) {
  return static_cast<std::uint8_t>(10 * (static_cast<int>(level) + 1));
}

}  // namespace

RosoutPublisher::RosoutPublisher(std::shared_ptr<LogSink> sink) : sink_(std::move(sink)) {
  sink_->keep_records(256, [this] { logged_.raise(); });
}

RosoutPublisher::~RosoutPublisher() {
  sink_->keep_records(0);
}

// What was logged before.
Result<void> RosoutPublisher::activate() {
  logged_.raise();
  return {};
}

Result<void> RosoutPublisher::deactivate() {
  publish();
  return {};
}

void RosoutPublisher::publish() {
  LogRecord record;
  const auto send = [&](const LogRecord& from) {
    rcl_interfaces::msg::Log message;
    message.stamp = to_stamp(from.stamp);
    message.level = to_ros(from.level);
    message.name = from.name.data();
    message.msg = from.text.data();
    rosout_.publish(message);
  };
  while (sink_->take(record)) send(record);
  const std::uint64_t drops = sink_->dropped();
  if (drops == reported_drops_) return;
  log().warn("{} log messages did not reach /rosout: too many at once", drops - reported_drops_);
  reported_drops_ = drops;
}

}  // namespace adit
