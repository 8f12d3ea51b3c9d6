// The options that name a deployment file and change it: the same for `adit run` and for the processes it starts.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "bringup/deployment/deployment.hpp"

namespace adit {

struct DeploymentArguments {
  std::string path;
  std::string middleware;
  std::string network;
  std::optional<std::uint32_t> domain;
  std::vector<std::string> variables;  // NAME=VALUE

  void add_to(CLI::App& command);
  DeploymentOverrides overrides() const;
  // The words that make another `adit` read the same deployment.
  std::vector<std::string> command_line() const;
};

}  // namespace adit
