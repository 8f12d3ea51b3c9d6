// A deployment file: which processes run which components, how they are connected, and what happens when one ends.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "bringup/supervisor/restart_policy.hpp"
#include "components/runtime/process.hpp"
#include "idl/result.hpp"
#include "middleware/time.hpp"

namespace adit {

struct DeployedProcess {
  ProcessConfig process;
  RestartPolicy restart;
  bool starts_when_linked = false;  // a source: started when the links between all other processes are matched
  bool stops_all = false;           // when it ends well, the whole deployment is done (a player, a test)
  Duration stop_timeout = std::chrono::seconds(5);  // from SIGTERM to SIGKILL
  std::map<std::string, std::string> environment;
};

struct Deployment {
  std::string path;
  std::vector<DeployedProcess> processes;
};

// What the command line may say differently from the file.
struct DeploymentOverrides {
  std::optional<std::string> middleware;
  std::optional<std::uint32_t> domain;
  std::optional<std::string> network;
  std::map<std::string, std::string> variables;  // --set name=value for ${name} in the file
};

// Reads and checks a file. ${name} is replaced by the variable, else by the environment, else by the default of
// ${name:-default}. Errors carry file:line, all of them at once: unknown keys, wrong types, two processes or components
// of one name, unknown component types, parameters and inputs that their component does not have.
Result<Deployment> load_deployment(const std::string& path, const DeploymentOverrides& overrides = {});

// The same without making any component: for a process that its supervisor started from a file it has checked. Loading
// every other process's components again would cost memory and time at each start.
Result<Deployment> read_deployment(const std::string& path, const DeploymentOverrides& overrides = {});

// The parameters that a ROS 2 parameter file gives to one component, as a deployment that names the file would.
Result<Value::Map> load_parameters(const std::string& path, const std::string& type, const std::string& node);

// Text with every ${...} replaced. An unknown name is an error with its line.
Result<std::string> substitute(const std::string& text, const std::string& name,
                               const std::map<std::string, std::string>& variables);

// How many endpoints of other processes (those that start at once) each port of `process` has to be matched with before
// its links are complete, by topic.
struct ExpectedMatches {
  std::map<std::string, std::uint32_t> writers;  // for its inputs
  std::map<std::string, std::uint32_t> readers;  // for its outputs
};
Result<ExpectedMatches> expected_matches(const Deployment& deployment, const std::string& process);

// Ports of all components by process, without opening DDS: pairs on one topic whose types or QoS do not match, as
// readable findings. Empty when everything fits.
Result<std::vector<std::string>> check_links(const Deployment& deployment);

}  // namespace adit
