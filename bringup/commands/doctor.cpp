#include "bringup/doctor/doctor.hpp"

#include <algorithm>
#include <cstdio>

#include "bringup/commands/command.hpp"

namespace adit {

void add_doctor_command(CLI::App& app, ExitCode& code) {
  auto config = std::make_shared<ParticipantConfig>();
  CLI::App* command =
      app.add_subcommand("doctor", "check kernel, memory, network, clock, permissions, vendors and QoS");
  add_participant_options(*command, *config);
  command->callback([config, &code] {
    const std::vector<doctor::Finding> findings = doctor::examine({}, *config);
    std::fputs(doctor::to_text(findings).c_str(), stdout);
    const bool failed = std::any_of(findings.begin(), findings.end(), [](const doctor::Finding& finding) {
      return finding.level == doctor::Finding::Level::failure;
    });
    if (failed) code = 1;
  });
}

}  // namespace adit
