#include "components/runtime/services/diagnostics_publisher.hpp"

#include <fmt/core.h>

#include "components/runtime/stamp.hpp"

namespace adit {
namespace {

using diagnostic_msgs::msg::DiagnosticStatus;

void add(DiagnosticStatus& status, std::string key, std::string value) {
  auto& entry = status.values.emplace_back();
  entry.key = std::move(key);
  entry.value = std::move(value);
}

void add_inputs(DiagnosticStatus& out, const ComponentStatus& status) {
  for (const InputStatus& input : status.inputs) {
    const InputStats& s = input.stats;
    add(out, "input " + input.name,
        fmt::format(
            "topic={} handled={} waiting={} dropped={} refused={} received={} lost={} overwritten={} rejected={} "
            "matched={}",
            input.topic, s.handled, s.waiting, s.dropped, s.refused, s.link.received, s.link.lost, s.link.overwritten,
            s.link.rejected, s.link.matched));
    if (s.refused > 0) add(out, "input " + input.name + " last refusal", s.last_refusal);
  }
}

void add_outputs(DiagnosticStatus& out, const ComponentStatus& status) {
  for (const OutputStatus& output : status.outputs) {
    const OutputStats& s = output.stats;
    add(out, "output " + output.name,
        fmt::format("topic={} published={} refused={} local_readers={} sent={} send_failed={} matched={}", output.topic,
                    s.published, s.refused, s.local_readers, s.link.sent, s.link.send_failed, s.link.matched));
  }
}

}  // namespace

DiagnosticStatus to_diagnostic(const ComponentStatus& status, const std::string& process) {
  DiagnosticStatus out;
  out.level = static_cast<std::uint8_t>(status.health);
  out.name = status.name;
  out.hardware_id = process;
  out.message = std::string(to_string(status.state));
  if (!status.reason.empty()) out.message += ": " + status.reason;
  add(out, "type", status.type);
  add(out, "lifecycle", std::string(to_string(status.state)));
  add(out, "health", std::string(to_string(status.health)));
  add(out, "cpu_s", fmt::format("{:.3f}", status.cpu_seconds));
  add(out, "busy_s", fmt::format("{:.3f}", status.busy_seconds));
  add_inputs(out, status);
  add_outputs(out, status);
  for (const TimerStats& timer : status.timers) {
    add(out, "timer " + timer.name, fmt::format("fired={} missed={}", timer.fired, timer.missed));
  }
  return out;
}

void DiagnosticsPublisher::publish() {
  if (!diagnostics_.has_readers()) return;
  diagnostic_msgs::msg::DiagnosticArray array;
  array.header.stamp = to_stamp(clock().now());
  for (const ComponentStatus& status : status_()) array.status.push_back(to_diagnostic(status, process_));
  diagnostics_.publish(array);
}

}  // namespace adit
