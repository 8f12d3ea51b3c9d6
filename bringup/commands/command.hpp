// The commands of `adit`. Each adds itself to the program and sets the exit code when it was chosen.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

#include "idl/result.hpp"
#include "middleware/config.hpp"

namespace adit {

// 0: done; 1: the work failed or a check found something; 2: wrong arguments (CLI11's own errors included).
using ExitCode = int;

void add_run_command(CLI::App& app, ExitCode& code);
void add_run_offline_command(CLI::App& app, ExitCode& code);
void add_suite_command(CLI::App& app, ExitCode& code);
void add_host_command(CLI::App& app, ExitCode& code);
void add_odometry_command(CLI::App& app, ExitCode& code);
void add_thermal_odometry_command(CLI::App& odometry, ExitCode& code);
void add_map_command(CLI::App& app, ExitCode& code);
void add_map_truth_command(CLI::App& app, ExitCode& code);
void add_evaluate_command(CLI::App& app, ExitCode& code);
void add_simulate_command(CLI::App& app, ExitCode& code);
void add_record_command(CLI::App& app, ExitCode& code);
void add_play_command(CLI::App& app, ExitCode& code);
void add_topic_command(CLI::App& app, ExitCode& code);
void add_node_command(CLI::App& app, ExitCode& code);
void add_doctor_command(CLI::App& app, ExitCode& code);
void add_explain_command(CLI::App& app, ExitCode& code);

// --middleware, --domain, --network, --peer, --multicast, --ros-distro into `config`; defaults from $ADIT_MIDDLEWARE, $ADIT_DOMAIN.
void add_participant_options(CLI::App& app, ParticipantConfig& config);

// Prints "adit: <message>" on stderr and returns 1.
ExitCode fail(const Error& error);

}  // namespace adit
