// The `adit` program: one command a file in commands/.
#include "bringup/commands/command.hpp"
#include "bringup/commands/file_commands.hpp"

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
#ifdef ADIT_HAS_FILE_COMMANDS
  if (const auto added = adit::add_file_commands(app, code, argc, argv); !added) return adit::fail(added.error());
#endif
  CLI11_PARSE(app, argc, argv);
  return code;
}
