#include "bringup/commands/file_commands.hpp"

extern "C" __attribute__((visibility("default"))) void adit_file_commands(CLI::App& app, adit::ExitCode& code) {
  adit::add_evaluate_command(app, code);
  adit::add_odometry_command(app, code);
  adit::add_map_command(app, code);
  adit::add_map_truth_command(app, code);
#ifdef ADIT_HAS_SIMULATOR
  adit::add_simulate_command(app, code);
  adit::add_run_offline_command(app, code);
  adit::add_suite_command(app, code);
#endif
}
