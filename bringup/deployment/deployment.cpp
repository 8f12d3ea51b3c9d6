#include "bringup/deployment/deployment.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "components/config/yaml_reader.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/component_core.hpp"
#include "middleware/ros/names.hpp"

namespace adit {
namespace {

// What of a file applies to every process.
struct Common {
  ParticipantConfig middleware;
  bool use_sim_time = false;
  std::map<std::string, Value::Map> parameters;  // from ROS 2 parameter files: by node name, "/**" for all
};

Value to_value(const YamlValue& value, const std::string& where) {
  Value converted = std::visit(
      [&](const auto& content) -> Value {
        using T = std::decay_t<decltype(content)>;
        if constexpr (requires { typename T::allocator_type; } && !std::is_same_v<T, std::string>) {
          Value::List list;
          for (const auto& item : content) {
            list.emplace_back(static_cast<typename T::value_type>(item));
            list.back().where = where;
          }
          return Value(std::move(list));
        } else {
          return Value(content);
        }
      },
      value);
  converted.where = where;
  return converted;
}

Value::Map parameter_map(const YamlSection& section) {
  Value::Map map;
  for (const std::string& key : section.keys()) {
    if (section.is_section(key)) {
      map.emplace_back(key, Value(parameter_map(section.section(key))));
    } else if (const std::optional<YamlValue> value = section.value(key)) {
      map.emplace_back(key, to_value(*value, section.place(key)));
    }
  }
  return map;
}

// Later entries win.
void merge(Value::Map& into, const Value::Map& from) {
  for (const auto& [key, value] : from) {
    std::erase_if(into, [&](const auto& entry) { return entry.first == key; });
    into.emplace_back(key, value);
  }
}

// What is said for all nodes concerns those that declare it, as in ROS 2; a type that does not exist is reported later.
Value::Map declared_only(Value::Map parameters, const std::string& type) {
  const Result<std::unique_ptr<Component>> component = components::create(type);
  if (!component) return {};
  const std::vector<ParamInfo> declared = (*component)->core().parameters();
  std::erase_if(parameters, [&](const auto& entry) {
    return std::none_of(declared.begin(), declared.end(),
                        [&](const ParamInfo& info) { return info.name == entry.first; });
  });
  return parameters;
}

// What the parameter files say to one component: for all nodes first, then by its names.
Value::Map parameters_of(const Common& common, const std::string& type, const std::string& name,
                         const std::string& node_namespace) {
  Value::Map parameters;
  for (const std::string& node : {std::string("/**"), name, join_node_name(node_namespace, name)}) {
    const auto found = common.parameters.find(node);
    if (found == common.parameters.end()) continue;
    merge(parameters, node == "/**" ? declared_only(found->second, type) : found->second);
  }
  return parameters;
}

void read_middleware(const YamlSection& section, ParticipantConfig& config) {
  config.vendor = section.choice("vendor", {"fastdds", "cyclonedds"}, config.vendor);
  config.network = section.text("network", config.network);
  config.peers = section.texts("peers", config.peers);
  config.multicast = section.flag("multicast", config.multicast);
  config.ros_distro = section.choice("ros_distro", {"humble", "iron", "jazzy", "none"}, config.ros_distro);
  config.shared_memory = section.flag("shared_memory", config.shared_memory);
  const YamlRange sizes{64.0 * 1024.0, 2.0 * 1024.0 * 1024.0 * 1024.0};
  config.shared_memory_bytes = static_cast<std::size_t>(
      section.integer("shared_memory_bytes", static_cast<std::int64_t>(config.shared_memory_bytes), sizes));
  config.socket_buffer_bytes = static_cast<std::size_t>(
      section.integer("socket_buffer_bytes", static_cast<std::int64_t>(config.socket_buffer_bytes), sizes));
  if (section.has("security")) {
    const YamlSection security = section.section("security");
    config.security = SecurityConfig{security.text("keystore"), security.text("enclave", "/")};
  }
}

RestartPolicy read_restart(const YamlSection& section) {
  RestartPolicy policy;
  const std::string when = section.choice("policy", {"never", "on-failure", "always"}, "on-failure");
  policy.when = when == "never"    ? RestartPolicy::When::never
                : when == "always" ? RestartPolicy::When::always
                                   : RestartPolicy::When::on_failure;
  policy.max = static_cast<int>(section.integer("max", policy.max, {-1, 1e6}));
  policy.backoff = section.duration("backoff", policy.backoff);
  policy.backoff_max = section.duration("backoff_max", std::max(policy.backoff_max, policy.backoff));
  policy.healthy_after = section.duration("healthy_after", policy.healthy_after);
  policy.silent_after = section.duration("silent_after", policy.silent_after);
  return policy;
}

ExecutorConfig read_executor(const YamlSection& section) {
  ExecutorConfig config;
  config.threads = static_cast<int>(section.integer("threads", config.threads, {1, 256}));
  config.priority = static_cast<int>(section.integer("priority", config.priority, {0, 99}));
  for (const std::int64_t cpu : section.integers("cpus", std::vector<std::int64_t>())) {
    if (cpu < 0 || cpu > 1023) section.error("cpus", "'cpus' must hold numbers of processors (0 is the first)");
    config.cpus.push_back(static_cast<int>(cpu));
  }
  config.lock_memory = section.flag("lock_memory", config.lock_memory);
  config.required = section.flag("required", config.required);
  return config;
}

void read_inputs(const YamlSection& section, ComponentConfig& config) {
  for (const std::string& name : section.keys()) {
    const YamlSection input = section.section(name);
    InputOverride& entry = config.inputs[name];
    if (input.has("queue")) entry.queue = static_cast<std::size_t>(input.integer("queue", {}, {1, 1e6}));
    if (input.has("when_full")) {
      const std::string when = input.choice("when_full", {"drop_oldest", "drop_newest", "block"});
      entry.when_full = when == "block"         ? WhenFull::block
                        : when == "drop_newest" ? WhenFull::drop_newest
                                                : WhenFull::drop_oldest;
    }
    if (input.has("reliability")) {
      entry.reliability = input.choice("reliability", {"reliable", "best_effort"}) == "reliable"
                              ? Qos::Reliability::reliable
                              : Qos::Reliability::best_effort;
    }
  }
}

ComponentConfig read_component(const YamlSection& section, const Common& common) {
  ComponentConfig config;
  config.type = section.text("type");
  config.name = section.text("name", config.type);
  config.namespace_ = section.text("namespace", "/");
  const YamlSection remap = section.section("remap");
  for (const std::string& from : remap.keys()) config.remap[from] = remap.text(from);
  read_inputs(section.section("inputs"), config);
  const std::string level =
      section.choice("log_level", {"debug", "info", "warn", "error", "fatal"}, std::string("info"));
  config.log_level = level == "debug"   ? LogLevel::debug
                     : level == "warn"  ? LogLevel::warn
                     : level == "error" ? LogLevel::error
                     : level == "fatal" ? LogLevel::fatal
                                        : LogLevel::info;
  Value::Map parameters = parameters_of(common, config.type, config.name, config.namespace_);
  merge(parameters, parameter_map(section.section("parameters")));
  config.parameters = Value(std::move(parameters));
  return config;
}

DeployedProcess read_process(const YamlSection& section, const Common& common) {
  DeployedProcess deployed;
  ProcessConfig& process = deployed.process;
  process.name = section.text("name");
  process.middleware = common.middleware;
  process.middleware.name = process.name;
  process.middleware.vendor = section.choice("middleware", {"fastdds", "cyclonedds"}, process.middleware.vendor);
  process.use_sim_time = section.flag("use_sim_time", common.use_sim_time);
  process.executor = read_executor(section.section("executor"));
  deployed.restart = read_restart(section.section("restart"));
  deployed.starts_when_linked = section.choice("start", {"now", "when_linked"}, "now") == "when_linked";
  deployed.stops_all = section.choice("when_done", {"nothing", "stop_all"}, "nothing") == "stop_all";
  deployed.stop_timeout = section.duration("stop_timeout", deployed.stop_timeout);
  const YamlSection environment = section.section("environment");
  for (const std::string& name : environment.keys()) deployed.environment[name] = environment.text(name);
  std::set<std::string> names;
  for (const YamlSection& component : section.sections("components")) {
    process.components.push_back(read_component(component, common));
    const std::string& name = process.components.back().name;
    if (!names.insert(name).second) component.error("name", "component '" + name + "' is there twice in this process");
  }
  if (process.components.empty()) section.error("components", "process '" + process.name + "' has no components");
  return deployed;
}

// "/**: {ros__parameters: {...}}", "lidar: {ros__parameters: {...}}", also below namespaces.
void read_parameter_nodes(const YamlSection& section, const std::string& prefix,
                          std::map<std::string, Value::Map>& parameters) {
  for (const std::string& key : section.keys()) {
    if (!section.is_section(key)) {
      section.error(key, "'" + key + "' is no node: expected node names with 'ros__parameters:' below them");
      section.value(key);
      continue;
    }
    const YamlSection inner = section.section(key);
    const std::string name = prefix.empty() || key.starts_with('/') ? prefix + key : prefix + "/" + key;
    if (inner.is_section("ros__parameters")) {
      merge(parameters[name], parameter_map(inner.section("ros__parameters")));
    } else {
      read_parameter_nodes(inner, name, parameters);
    }
  }
}

Result<void> read_parameter_file(const std::string& path, Common& common) {
  const Result<YamlDocument> document = YamlDocument::load(path);
  if (!document) return document.error();
  read_parameter_nodes(document->root(), "", common.parameters);
  return document->finish();
}

int line_at(const std::string& text, std::size_t position) {
  return 1 + static_cast<int>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(position), '\n'));
}

Result<std::string> read_text(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) return Error{ErrorCode::not_found, path + ": cannot read the deployment file"};
  return text.str();
}

// Names that must not repeat, and inputs, parameters and types that must exist: found by making each component once.
Result<void> check_components(const Deployment& deployment) {
  std::string problems;
  std::set<std::string> processes, nodes;
  for (const DeployedProcess& deployed : deployment.processes) {
    if (!processes.insert(deployed.process.name).second) {
      problems += deployment.path + ": two processes are called '" + deployed.process.name + "'\n";
    }
    for (const ComponentConfig& config : deployed.process.components) {
      const std::string node = join_node_name(config.namespace_, config.name);
      if (!nodes.insert(node).second) problems += deployment.path + ": two components are called '" + node + "'\n";
    }
    if (const Result<std::unique_ptr<Process>> process = Process::build(deployed.process); !process) {
      problems += process.error().message + "\n";
    }
  }
  if (problems.empty()) return {};
  problems.pop_back();
  return Error{ErrorCode::invalid_argument, problems};
}

}  // namespace

Result<std::string> substitute(const std::string& text, const std::string& name,
                               const std::map<std::string, std::string>& variables) {
  std::string result;
  std::size_t at = 0;
  for (std::size_t open = text.find("${"); open != std::string::npos; open = text.find("${", at)) {
    const std::size_t close = text.find('}', open);
    const auto bad = [&](const std::string& why) {
      return Error{ErrorCode::invalid_argument, name + ":" + std::to_string(line_at(text, open)) + ": " + why};
    };
    if (close == std::string::npos || text.substr(open, close - open).find('\n') != std::string::npos) {
      return bad("'${' without '}'");
    }
    std::string variable = text.substr(open + 2, close - open - 2);
    std::optional<std::string> value;
    if (const std::size_t otherwise = variable.find(":-"); otherwise != std::string::npos) {
      value = variable.substr(otherwise + 2);
      variable.resize(otherwise);
    }
    if (const auto given = variables.find(variable); given != variables.end()) {
      value = given->second;
    } else if (const char* environment = std::getenv(variable.c_str())) {
      value = environment;
    }
    if (!value)
      return bad("'" + variable + "' has no value: give --set " + variable + "=... or set it in the environment");
    result.append(text, at, open - at).append(*value);
    at = close + 1;
  }
  return result.append(text, at, std::string::npos);
}

Result<Value::Map> load_parameters(const std::string& path, const std::string& type, const std::string& node) {
  Common common;
  if (Result<void> read = read_parameter_file(path, common); !read) return read.error();
  return parameters_of(common, type, node, "/");
}

Result<Deployment> load_deployment(const std::string& path, const DeploymentOverrides& overrides) {
  Result<Deployment> deployment = read_deployment(path, overrides);
  if (!deployment) return deployment;
  if (Result<void> fine = check_components(*deployment); !fine) return fine.error();
  return deployment;
}

Result<Deployment> read_deployment(const std::string& path, const DeploymentOverrides& overrides) {
  Result<std::string> text = read_text(path);
  if (!text) return text.error();
  text = substitute(*text, path, overrides.variables);
  if (!text) return text.error();
  const Result<YamlDocument> document = YamlDocument::parse(*text, path);
  if (!document) return document.error();
  const YamlSection root = document->root();

  Common common;
  common.middleware.domain = static_cast<std::uint32_t>(root.integer("domain", 0, {0, 232}));
  read_middleware(root.section("middleware"), common.middleware);
  if (overrides.domain) common.middleware.domain = *overrides.domain;
  if (overrides.network) common.middleware.network = *overrides.network;
  common.use_sim_time = root.flag("use_sim_time", false);
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  for (const std::string& file : root.texts("parameter_files", std::vector<std::string>())) {
    if (Result<void> read = read_parameter_file((folder / file).string(), common); !read) return read.error();
  }
  Deployment deployment;
  deployment.path = path;
  for (const YamlSection& process : root.sections("processes")) {
    deployment.processes.push_back(read_process(process, common));
    if (overrides.middleware) deployment.processes.back().process.middleware.vendor = *overrides.middleware;
  }
  if (deployment.processes.empty()) root.error("processes", "there are no processes");
  if (Result<void> fine = document->finish(); !fine) return fine.error();
  return deployment;
}

Result<ExpectedMatches> expected_matches(const Deployment& deployment, const std::string& process) {
  ExpectedMatches expected;
  for (const DeployedProcess& deployed : deployment.processes) {
    if (deployed.process.name == process || deployed.starts_when_linked) continue;
    const Result<std::unique_ptr<Process>> built = Process::build(deployed.process);
    if (!built) return built.error();
    for (const PortInfo& port : (*built)->ports()) {
      ++(port.direction == PortInfo::Direction::output ? expected.writers : expected.readers)[port.topic];
    }
  }
  return expected;
}

Result<std::vector<std::string>> check_links(const Deployment& deployment) {
  std::vector<PortInfo> ports;
  for (const DeployedProcess& deployed : deployment.processes) {
    const Result<std::unique_ptr<Process>> process = Process::build(deployed.process);
    if (!process) return process.error();
    const std::vector<PortInfo> more = (*process)->ports();
    ports.insert(ports.end(), more.begin(), more.end());
  }
  std::vector<std::string> findings;
  for (const PortInfo& writer : ports) {
    for (const PortInfo& reader : ports) {
      if (writer.direction != PortInfo::Direction::output || reader.direction != PortInfo::Direction::input ||
          writer.topic != reader.topic) {
        continue;
      }
      const std::string pair = writer.topic + ": " + writer.component + " -> " + reader.component + ": ";
      if (writer.type->dds_name != reader.type->dds_name) {
        findings.push_back(pair + "writes " + std::string(writer.type->ros_name) + ", reads " +
                           std::string(reader.type->ros_name) + "; remap one of them");
        continue;
      }
      for (const Mismatch& m : check(writer.qos, reader.qos)) {
        findings.push_back(pair + m.policy + " offered " + m.offered + ", requested " + m.requested + "; " + m.remedy);
      }
    }
  }
  return findings;
}

}  // namespace adit
