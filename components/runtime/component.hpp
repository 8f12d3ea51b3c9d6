// What a component author includes: Component with its ports, parameters, timers, clock and log.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "components/runtime/clock.hpp"
#include "components/runtime/input.hpp"
#include "components/runtime/log.hpp"
#include "components/runtime/output.hpp"
#include "components/runtime/param.hpp"
#include "components/runtime/registry.hpp"
#include "components/runtime/status.hpp"
#include "components/runtime/timer.hpp"
#include "components/runtime/trigger.hpp"
#include "idl/result.hpp"
#include "middleware/qos.hpp"

namespace adit {

// A managed part of a process. Ports, parameters and timers are members that register themselves. All overridables and
// all handlers of one component run one at a time (its strand), never concurrently; which thread is not fixed. A
// handler that throws stops its component for good, not the process.
//
//   unconfigured --configure--> inactive --activate--> active --deactivate--> inactive --cleanup--> unconfigured
class Component {
 public:
  Component();
  virtual ~Component();
  Component(const Component&) = delete;
  Component& operator=(const Component&) = delete;

  // Used by the runtime, not by authors.
  ComponentCore& core() { return *core_; }

 protected:
  // Parameters have their values; ports are not open yet. An error refuses the transition, with its message.
  virtual Result<void> configure() { return {}; }
  // Outputs may publish; inputs and timers start when it has returned.
  virtual Result<void> activate() { return {}; }
  // Inputs and timers have stopped; outputs may still publish.
  virtual Result<void> deactivate() { return {}; }
  // Back to the state before configure().
  virtual Result<void> cleanup() { return {}; }
  // Simulated time jumped back by -step: forget what was stamped later. Called while active.
  virtual void on_time_jump(Duration step) { static_cast<void>(step); }

  // This component's work is over (a recording is played): its process ends as if it had been asked to stop, after the
  // handler that calls this has returned. Nothing happens offline. Any thread.
  void finish();

  const std::string& name() const;       // "lidar_odometry"
  const std::string& full_name() const;  // "/perception/lidar_odometry"
  const Clock& clock() const;
  Logger& log();
  // Shown in /diagnostics until it is set again. Any thread.
  void health(Health level, std::string reason = {});

 private:
  friend class ComponentCore;
  std::unique_ptr<ComponentCore> core_;
};

}  // namespace adit
