// One process of a deployment: participant, executors, components; from configuration to clean shutdown.
#pragma once

#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "components/runtime/component_config.hpp"
#include "components/runtime/executor.hpp"
#include "components/runtime/param.hpp"
#include "components/runtime/status.hpp"
#include "middleware/config.hpp"

namespace adit {

class Component;
class Logger;
class Participant;

struct ProcessConfig {
  std::string name = "adit";
  ParticipantConfig middleware;
  ExecutorConfig executor;
  std::vector<ComponentConfig> components;   // configured and activated in this order, stopped in the reverse one
  bool use_sim_time = false;                 // the clock follows /clock
  bool diagnostics = true;                   // /diagnostics at 1 Hz
  bool rosout = true;                        // logs are mirrored to /rosout
  bool exit_when_a_component_fails = false;  // else the others go on, and run() says so when it ends
  LogLevel log_level = LogLevel::info;       // of the process itself
};

// Build, connect, start, run, shut down; destroying it shuts down. Owned and called by one thread; what is marked so
// may be called from any.
class Process {
 public:
  // Makes the components, resolves names, sets parameters. Opens nothing, starts no thread: what is wrong in a
  // deployment shows here.
  static Result<std::unique_ptr<Process>> build(const ProcessConfig& config);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  // What was built, before and after it runs.
  std::vector<PortInfo> ports() const;
  std::vector<std::pair<std::string, std::vector<ParamInfo>>> parameters() const;  // by component

  // Joins the domain of config.middleware and starts the threads.
  Result<void> open();
  // The same with a participant that exists already; nullptr: only the local bus.
  Result<void> connect(std::unique_ptr<Participant> participant);
  // Configures and activates each component in order, as far as its `start` says. On an error everything that was
  // started is stopped again.
  Result<void> start();
  // Returns when `stop` is requested, a component finishes, or one failed and exit_when_a_component_fails is set. Tells
  // the supervisor, when there is one, that it is alive (heartbeat.hpp). 0, or 1 when a component failed.
  int run(std::stop_token stop);
  void shutdown();

  // Lifecycle of single components by full name ("/lidar_odometry"): the tools' way in. Any thread, but one at a time.
  Result<void> bring(const std::string& component, LifecycleState state);

  // Any thread.
  std::vector<ComponentStatus> status() const;
  std::string explain() const;  // of the participant
  Participant* participant() const;
  Logger& log();
  // Called in the thread of the component that failed: be short.
  void on_failure(std::function<void(const std::string& component, const std::string& reason)> handler);

 private:
  Process();
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace adit
