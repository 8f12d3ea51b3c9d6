#include <unistd.h>

#include <cstdio>

#include "bringup/commands/command.hpp"
#include "bringup/commands/graph_table.hpp"
#include "bringup/commands/rate_meter.hpp"
#include "bringup/commands/topic_monitor.hpp"
#include "idl/type_registry.hpp"

namespace adit {
namespace {

struct Arguments {
  ParticipantConfig participant;
  double wait_s = 2.0;
  double duration_s = 0.0;  // 0: until Ctrl-C
  std::size_t window = 1000;
  std::size_t count = 0;  // 0: no limit
  std::string topic;
  bool types = false;
};

Duration nanoseconds(double seconds) {
  return Duration(static_cast<std::int64_t>(seconds * 1e9));
}

Result<void> list(const Arguments& arguments) {
  const Result<Graph> graph = observe(arguments.participant, arguments.wait_s);
  if (!graph) return graph.error();
  std::fputs(topic_list(*graph, arguments.types).c_str(), stdout);
  return {};
}

Result<void> info(const Arguments& arguments) {
  const Result<Graph> graph = observe(arguments.participant, arguments.wait_s);
  if (!graph) return graph.error();
  const std::string text = topic_details(*graph, arguments.topic);
  if (text.empty()) {
    return Error{ErrorCode::not_found, "no topic '" + arguments.topic + "' in domain " +
                                           std::to_string(arguments.participant.domain) + "; topics:\n" +
                                           topic_list(*graph, false)};
  }
  std::printf("%s\n%s", arguments.topic.c_str(), text.c_str());
  return {};
}

// Feeds a RateMeter with the samples and prints one of its lines each second, and at the end.
Result<void> measure(const Arguments& arguments, std::string (RateMeter::*line)() const) {
  Result<std::unique_ptr<TopicMonitor>> monitor =
      TopicMonitor::open(arguments.participant, arguments.topic, nanoseconds(arguments.wait_s));
  if (!monitor) return monitor.error();
  const MessageType* const type = find_type((*monitor)->type());
  const bool stamped = type && begins_with_stamp(*type->info);
  if (line == &RateMeter::delay && !stamped) {
    return Error{ErrorCode::invalid_argument,
                 (*monitor)->type() + " does not begin with a stamp: its delay is unknown"};
  }
  RateMeter meter(arguments.window);
  std::size_t seen = 0;
  auto printed = std::chrono::steady_clock::now();
  const bool live = ::isatty(STDOUT_FILENO) != 0;
  (*monitor)->run(arguments.duration_s > 0.0 ? std::optional(nanoseconds(arguments.duration_s)) : std::nullopt,
                  [&](const Sample& sample) {
                    const Time arrival = sample.info().received_time;
                    const std::optional<Time> stamp = stamped ? leading_stamp(sample.bytes()) : std::nullopt;
                    meter.add(arrival, sample.bytes().size(), stamp ? std::optional(arrival - *stamp) : std::nullopt);
                    const auto now = std::chrono::steady_clock::now();
                    if (live && now - printed >= std::chrono::seconds(1)) {
                      printed = now;
                      std::printf("%s\n", (meter.*line)().c_str());
                      std::fflush(stdout);
                    }
                    return ++seen != arguments.count;
                  });
  const LinkStats stats = (*monitor)->stats();
  std::printf("%s  received %llu lost %llu overwritten %llu\n", (meter.*line)().c_str(),
              static_cast<unsigned long long>(stats.received), static_cast<unsigned long long>(stats.lost),
              static_cast<unsigned long long>(stats.overwritten));
  if (seen == 0) return Error{ErrorCode::timeout, "no message arrived on '" + arguments.topic + "'"};
  return {};
}

Result<void> echo(const Arguments& arguments) {
  Result<std::unique_ptr<TopicMonitor>> monitor =
      TopicMonitor::open(arguments.participant, arguments.topic, nanoseconds(arguments.wait_s));
  if (!monitor) return monitor.error();
  const MessageType* const type = find_type((*monitor)->type());
  if (!type) {
    return Error{ErrorCode::not_found,
                 "the type " + (*monitor)->type() +
                     " is not built in: add its .idl file under idl/ (hz, bw and info work without)"};
  }
  std::size_t seen = 0;
  std::size_t malformed = 0;
  std::string text;
  const JsonOptions options;
  (*monitor)->run(arguments.duration_s > 0.0 ? std::optional(nanoseconds(arguments.duration_s)) : std::nullopt,
                  [&](const Sample& sample) {
                    text.clear();
                    const DecodeStatus status = type->to_json(sample.bytes(), text, options);
                    if (status == DecodeStatus::ok) {
                      std::printf("%s\n", text.c_str());
                    } else {
                      ++malformed;
                      std::fprintf(stderr, "adit: message refused: %s\n", std::string(to_string(status)).c_str());
                    }
                    std::fflush(stdout);
                    return ++seen != arguments.count;
                  });
  if (malformed > 0) return Error{ErrorCode::malformed, std::to_string(malformed) + " malformed messages"};
  if (seen == 0) return Error{ErrorCode::timeout, "no message arrived on '" + arguments.topic + "'"};
  return {};
}

}  // namespace

void add_topic_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  arguments->participant.name = "adit topic";
  CLI::App* command = app.add_subcommand("topic", "topics of the domain: list, info, echo, hz, bw, delay");
  command->require_subcommand(1);
  const auto add = [&](const char* name, const char* help, std::function<Result<void>(const Arguments&)> run) {
    CLI::App* sub = command->add_subcommand(name, help);
    add_participant_options(*sub, arguments->participant);
    sub->add_option("--wait", arguments->wait_s, "longest time to wait for discovery [s]")->capture_default_str();
    sub->callback([arguments, run = std::move(run), &code] {
      if (Result<void> done = run(*arguments); !done) code = fail(done.error());
    });
    return sub;
  };
  add("list", "names of all topics", list)->add_flag("-t,--types", arguments->types, "with types and endpoint counts");
  CLI::App* const on_topic[] = {
      add("info", "endpoints of a topic, their QoS, and why some do not match", info),
      add("echo", "print messages as JSON, one a line", echo),
      add("hz", "rate", [](const Arguments& a) { return measure(a, &RateMeter::rate); }),
      add("bw", "bandwidth", [](const Arguments& a) { return measure(a, &RateMeter::bandwidth); }),
      add("delay", "arrival minus header stamp", [](const Arguments& a) { return measure(a, &RateMeter::delay); })};
  for (CLI::App* sub : on_topic) {
    sub->add_option("topic", arguments->topic, "e.g. /lidar/points")->required();
    if (sub == on_topic[0]) continue;
    sub->add_option("--duration", arguments->duration_s, "stop after this time [s] (default: Ctrl-C)");
    sub->add_option("-n,--count", arguments->count, "stop after this many messages");
    if (sub != on_topic[1]) {
      sub->add_option("--window", arguments->window, "messages the figures are taken over")->capture_default_str();
    }
  }
}

}  // namespace adit
