#include "bringup/commands/deployment_options.hpp"

namespace adit {

void DeploymentArguments::add_to(CLI::App& command) {
  command.add_option("deployment", path, "deployment file (YAML)")->required()->check(CLI::ExistingFile);
  command.add_option("--middleware", middleware, "fastdds or cyclonedds, for all processes")
      ->check(CLI::IsMember({"fastdds", "cyclonedds"}));
  command.add_option("--domain", domain, "DDS domain instead of the file's")->check(CLI::Range(0, 232));
  command.add_option("--network", network, "network instead of the file's");
  command.add_option("--set", variables, "NAME=VALUE for ${NAME} in the file (repeatable)");
}

DeploymentOverrides DeploymentArguments::overrides() const {
  DeploymentOverrides overrides;
  if (!middleware.empty()) overrides.middleware = middleware;
  if (!network.empty()) overrides.network = network;
  overrides.domain = domain;
  for (const std::string& variable : variables) {
    const std::size_t equals = variable.find('=');
    overrides.variables[variable.substr(0, equals)] = equals == std::string::npos ? "" : variable.substr(equals + 1);
  }
  return overrides;
}

std::vector<std::string> DeploymentArguments::command_line() const {
  std::vector<std::string> words = {path};
  const auto add = [&](const char* option, const std::string& value) {
    words.push_back(option);
    words.push_back(value);
  };
  if (!middleware.empty()) add("--middleware", middleware);
  if (!network.empty()) add("--network", network);
  if (domain) add("--domain", std::to_string(*domain));
  for (const std::string& variable : variables) add("--set", variable);
  return words;
}

}  // namespace adit
