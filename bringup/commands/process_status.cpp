#include "bringup/commands/process_status.hpp"

#include <fstream>

#include <nlohmann/json.hpp>

namespace adit {

LinkTotals& LinkTotals::operator+=(const LinkTotals& other) {
  sent += other.sent;
  received += other.received;
  lost += other.lost;
  dropped += other.dropped;
  return *this;
}

ProcessStatus summarize(const Process& process) {
  ProcessStatus summary;
  for (const ComponentStatus& component : process.status()) {
    summary.cpu_s[component.name] = component.cpu_seconds;
    for (const OutputStatus& output : component.outputs) summary.links[output.topic].sent += output.stats.published;
    for (const InputStatus& input : component.inputs) {
      LinkTotals& link = summary.links[input.topic];
      link.received += input.stats.handled;
      link.lost += input.stats.link.lost + input.stats.link.overwritten + input.stats.link.rejected;
      link.dropped += input.stats.dropped + input.stats.refused;
    }
  }
  return summary;
}

Result<void> write_process_status(const std::string& path, const ProcessStatus& status) {
  nlohmann::json json;
  for (const auto& [topic, link] : status.links)
    json["links"][topic] = {link.sent, link.received, link.lost, link.dropped};
  for (const auto& [component, cpu_s] : status.cpu_s) json["cpu_s"][component] = cpu_s;
  std::ofstream file(path);
  file << json.dump();
  file.flush();
  if (!file) return Error{ErrorCode::io, path + ": cannot write"};
  return {};
}

Result<ProcessStatus> read_process_status(const std::string& path) {
  std::ifstream file(path);
  const nlohmann::json json = nlohmann::json::parse(file, nullptr, false);
  if (!json.is_object()) return Error{ErrorCode::not_found, path + ": no status"};
  ProcessStatus status;
  if (json.contains("links")) {
    for (const auto& [topic, link] : json["links"].items()) {
      status.links[topic] = {link.at(0), link.at(1), link.at(2), link.at(3)};
    }
  }
  if (json.contains("cpu_s")) {
    for (const auto& [component, cpu_s] : json["cpu_s"].items()) status.cpu_s[component] = cpu_s;
  }
  return status;
}

}  // namespace adit
