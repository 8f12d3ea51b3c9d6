#include <cstdio>

#include "bringup/commands/command.hpp"
#include "bringup/commands/graph_table.hpp"

namespace adit {
namespace {

struct Arguments {
  ParticipantConfig participant;
  double wait_s = 2.0;
  std::string node;
};

}  // namespace

void add_node_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  arguments->participant.name = "adit node";
  CLI::App* command = app.add_subcommand("node", "nodes of the domain");
  command->require_subcommand(1);
  CLI::App* list = command->add_subcommand("list", "names of all nodes");
  CLI::App* info = command->add_subcommand("info", "topics that a node writes and reads");
  info->add_option("node", arguments->node, "fully qualified, e.g. /lidar_odometry")->required();
  for (CLI::App* sub : {list, info}) {
    add_participant_options(*sub, arguments->participant);
    sub->add_option("--wait", arguments->wait_s, "longest time to wait for discovery [s]")->capture_default_str();
  }
  list->callback([arguments, &code] {
    const Result<Graph> graph = observe(arguments->participant, arguments->wait_s);
    if (!graph) {
      code = fail(graph.error());
      return;
    }
    std::fputs(node_list(*graph).c_str(), stdout);
  });
  info->callback([arguments, &code] {
    const Result<Graph> graph = observe(arguments->participant, arguments->wait_s);
    if (!graph) {
      code = fail(graph.error());
      return;
    }
    const std::string text = node_details(*graph, arguments->node);
    if (text.empty()) {
      code = fail({ErrorCode::not_found, "no node '" + arguments->node + "' in domain " +
                                             std::to_string(arguments->participant.domain) + "; nodes:\n" +
                                             node_list(*graph)});
      return;
    }
    std::printf("%s\n%s", arguments->node.c_str(), text.c_str());
  });
}

}  // namespace adit
