// The commands that work on files with the whole stack: they need PCL with VTK (PCD files) and Embree (the simulator).
// They live in a module, libadit_file_commands.so, that `adit` loads when one of them is asked for: boards do not have
// it, and everything else, `adit --help` too, does not wait for those libraries.
#pragma once

#include <array>

#include "bringup/commands/command.hpp"

namespace adit {

struct FileCommand {
  const char* name;
  const char* description;
};

namespace file_commands {

inline constexpr FileCommand evaluate{"evaluate",
                                      "compare trajectories with the truth: table, summary.json, report.html"};
inline constexpr FileCommand odometry{"odometry", "one front end offline on files, bit-identical from run to run"};
inline constexpr FileCommand map{"map", "a map from a folder of clouds and their odometry, loops closed"};
inline constexpr FileCommand map_truth{"map-truth", "where a recorded drive was in a map made before, as ground truth"};
inline constexpr FileCommand simulate{"simulate", "a tunnel scenario into a folder of files or a ROS 2 bag"};
inline constexpr FileCommand run_offline{
    "run-offline", "a deployment's components in one process, without DDS: as fast as it goes, bit-identical"};
inline constexpr FileCommand suite{"suite",
                                   "a deployment offline on many scenarios with many seeds: medians and worst"};
#ifdef ADIT_HAS_SIMULATOR
inline constexpr std::array all{evaluate, odometry, map, map_truth, simulate, run_offline, suite};
#else
inline constexpr std::array all{evaluate, odometry, map, map_truth};
#endif

// What the module exports under the name `entry_point`: adds its commands to `app`.
using EntryPoint = void(CLI::App& app, ExitCode& code);
inline constexpr const char* entry_point = "adit_file_commands";

}  // namespace file_commands

// Adds the file commands where their module is installed: as names for the list of commands, or, when the first
// argument is one of them, in earnest out of the module.
Result<void> add_file_commands(CLI::App& app, ExitCode& code, int argc, const char* const* argv);

}  // namespace adit
