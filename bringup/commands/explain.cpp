#include <cstdio>

#include "bringup/commands/command.hpp"
#include "middleware/participant.hpp"

namespace adit {

// Opens a participant exactly as a component process would and prints what the vendor made of it.
void add_explain_command(CLI::App& app, ExitCode& code) {
  auto config = std::make_shared<ParticipantConfig>();
  config->name = "adit explain";
  CLI::App* command = app.add_subcommand("explain", "print the vendor configuration really used");
  add_participant_options(*command, *config);
  command->callback([config, &code] {
    const Result<std::unique_ptr<Participant>> participant = open(*config);
    if (!participant) {
      code = fail(participant.error());
      return;
    }
    std::fputs((*participant)->explain().c_str(), stdout);
  });
}

}  // namespace adit
