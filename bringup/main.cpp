// The `adit` program: one command a file in commands/.
#include "bringup/commands/command.hpp"

int main(int argc, char** argv) {
  CLI::App app("Adit: DDS components and tunnel localization", "adit");
  app.require_subcommand(1);
  adit::ExitCode code = 0;
  adit::add_run_command(app, code);
  adit::add_host_command(app, code);
  adit::add_topic_command(app, code);
  adit::add_node_command(app, code);
  adit::add_doctor_command(app, code);
  adit::add_explain_command(app, code);
#ifdef ADIT_HAS_RECORDING
  adit::add_record_command(app, code);
  adit::add_play_command(app, code);
#endif
#ifdef ADIT_HAS_STACK
  adit::add_evaluate_command(app, code);
  adit::add_odometry_command(app, code);
#endif
#ifdef ADIT_HAS_SIMULATOR
  adit::add_simulate_command(app, code);
  adit::add_run_offline_command(app, code);
  adit::add_suite_command(app, code);
#endif
  CLI11_PARSE(app, argc, argv);
  return code;
}
