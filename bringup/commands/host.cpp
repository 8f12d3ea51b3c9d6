#include <sys/socket.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <thread>

#include "bringup/commands/command.hpp"
#include "bringup/commands/deployment_options.hpp"
#include "bringup/commands/process_status.hpp"
#include "bringup/supervisor/supervisor.hpp"
#include "components/runtime/process.hpp"
#include "middleware/participant.hpp"

namespace adit {
namespace {

struct Arguments {
  DeploymentArguments deployment;
  std::string process;
  std::string status_file;
  std::vector<std::string> states;            // /node=inactive
  std::vector<std::string> expected_writers;  // /topic=count
  std::vector<std::string> expected_readers;
};

// SIGINT and SIGTERM as a stop request. Blocks them for all threads that are started later.
class StopOnSignal {
 public:
  StopOnSignal() : source_(std::make_unique<std::stop_source>()) {
    ::sigemptyset(&signals_);
    ::sigaddset(&signals_, SIGINT);
    ::sigaddset(&signals_, SIGTERM);
    ::pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
    waiter_ = std::jthread([this](const std::stop_token& over) {
      const timespec slice{0, 50'000'000};
      while (!over.stop_requested()) {
        if (::sigtimedwait(&signals_, nullptr, &slice) > 0) source_->request_stop();
      }
    });
  }
  std::stop_token token() const { return source_->get_token(); }

 private:
  sigset_t signals_{};
  std::unique_ptr<std::stop_source> source_;
  std::jthread waiter_;
};

Result<void> apply_states(const std::vector<std::string>& states, ProcessConfig& config) {
  for (const std::string& state : states) {
    const std::size_t equals = state.find('=');
    const std::string wanted = equals == std::string::npos ? "" : state.substr(equals + 1);
    bool found = false;
    for (ComponentConfig& component : config.components) {
      if (resolve_name(component.name, component.namespace_, "") != state.substr(0, equals)) continue;
      found = true;
      for (const LifecycleState known :
           {LifecycleState::unconfigured, LifecycleState::inactive, LifecycleState::active}) {
        if (wanted == to_string(known)) component.start = known;
      }
    }
    if (!found) return Error{ErrorCode::invalid_argument, "--state '" + state + "' names no component of this process"};
  }
  return {};
}

// Tells the supervisor once when every link to the other processes is matched; a deployment may hold its sources back
// until then, so that nothing of what they send is lost while the others still find each other.
class LinkReporter {
 public:
  LinkReporter(const Process& process, ExpectedMatches expected) {
    const char* const socket = std::getenv("ADIT_SUPERVISOR_FD");
    if (!socket) return;
    thread_ =
        std::jthread([&process, expected = std::move(expected), fd = std::atoi(socket)](const std::stop_token& over) {
          while (!over.stop_requested() && !complete(process, expected)) {
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
          }
          if (!over.stop_requested()) ::send(fd, links_complete.data(), links_complete.size(), MSG_NOSIGNAL);
        });
  }

 private:
  static bool complete(const Process& process, const ExpectedMatches& expected) {
    const auto matched = [](const std::map<std::string, std::uint32_t>& wanted, const std::string& topic,
                            std::uint32_t is) {
      const auto found = wanted.find(topic);
      return found == wanted.end() || is >= found->second;
    };
    for (const ComponentStatus& component : process.status()) {
      for (const InputStatus& input : component.inputs) {
        if (!matched(expected.writers, input.topic, input.stats.link.matched)) return false;
      }
      for (const OutputStatus& output : component.outputs) {
        if (!matched(expected.readers, output.topic, output.stats.link.matched)) return false;
      }
    }
    return true;
  }
  std::jthread thread_;
};

std::map<std::string, std::uint32_t> counts(const std::vector<std::string>& words) {
  std::map<std::string, std::uint32_t> by_topic;
  for (const std::string& word : words) {
    const std::size_t equals = word.find('=');
    if (equals != std::string::npos)
      by_topic[word.substr(0, equals)] = static_cast<std::uint32_t>(std::atoi(&word[equals + 1]));
  }
  return by_topic;
}

Result<int> host(const Arguments& arguments) {
  const StopOnSignal stop;
  Result<Deployment> deployment = read_deployment(arguments.deployment.path, arguments.deployment.overrides());
  if (!deployment) return deployment.error();
  const auto deployed = std::find_if(deployment->processes.begin(), deployment->processes.end(),
                                     [&](const DeployedProcess& p) { return p.process.name == arguments.process; });
  if (deployed == deployment->processes.end()) {
    return Error{ErrorCode::not_found, arguments.deployment.path + " has no process '" + arguments.process + "'"};
  }
  if (Result<void> set = apply_states(arguments.states, deployed->process); !set) return set.error();
  Result<std::unique_ptr<Process>> process = Process::build(deployed->process);
  if (!process) return process.error();
  Result<std::unique_ptr<Participant>> participant = open(deployed->process.middleware);
  if (!participant) return participant.error();
  if (Result<void> connected = (*process)->connect(*std::move(participant)); !connected) return connected.error();
  if (Result<void> started = (*process)->start(); !started) return started.error();
  const int code = [&] {
    const LinkReporter reporter(**process, {counts(arguments.expected_writers), counts(arguments.expected_readers)});
    return (*process)->run(stop.token());
  }();
  if (!arguments.status_file.empty()) {
    if (Result<void> written = write_process_status(arguments.status_file, summarize(**process)); !written) {
      return written.error();
    }
  }
  (*process)->shutdown();
  return code;
}

}  // namespace

void add_host_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("host", "run one process of a deployment (what `adit run` starts)");
  arguments->deployment.add_to(*command);
  command->add_option("--process", arguments->process, "its name in the file")->required();
  command->add_option("--status-file", arguments->status_file, "write counters here at the end");
  command->add_option("--expect-writers", arguments->expected_writers, "TOPIC=COUNT to be matched with (repeatable)");
  command->add_option("--expect-readers", arguments->expected_readers, "TOPIC=COUNT to be matched with (repeatable)");
  command->add_option("--state", arguments->states, "/NODE=unconfigured|inactive|active to start in (repeatable)");
  command->callback([arguments, &code] {
    const Result<int> done = host(*arguments);
    code = done ? *done : fail(done.error());
  });
}

}  // namespace adit
