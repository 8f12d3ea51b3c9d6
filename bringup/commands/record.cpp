#include <unistd.h>

#include <cstdio>
#include <filesystem>

#include "bringup/commands/command.hpp"
#include "bringup/commands/interrupt.hpp"
#include "bringup/recording/recorder.hpp"

namespace adit {
namespace {

struct Arguments {
  RecorderConfig recorder;
  bool all = false;
  double duration_s = 0.0;  // 0: until Ctrl-C
};

// "bag_2026-11-22_14-03-05": where a recording goes that was given no folder.
std::string folder_of_now() {
  const std::time_t now = std::time(nullptr);
  char text[64];
  std::strftime(text, sizeof text, "bag_%Y-%m-%d_%H-%M-%S", std::localtime(&now));
  return text;
}

std::string totals(const std::vector<Recorder::TopicState>& topics) {
  std::uint64_t samples = 0, bytes = 0, lost = 0;
  for (const Recorder::TopicState& topic : topics) {
    samples += topic.samples;
    bytes += topic.bytes;
    lost += topic.lost;
  }
  char text[128];
  std::snprintf(text, sizeof text, "%zu topics, %llu messages, %.1f MB, %llu lost", topics.size(),
                static_cast<unsigned long long>(samples), static_cast<double>(bytes) * 1e-6,
                static_cast<unsigned long long>(lost));
  return text;
}

Result<void> record(Arguments& arguments) {
  if (arguments.all != arguments.recorder.topics.empty()) {
    return Error{ErrorCode::invalid_argument, "name the topics to record, or --all (not both)"};
  }
  std::string& folder = arguments.recorder.folder;
  if (folder.empty()) folder = folder_of_now();
  if (std::filesystem::exists(folder)) {
    return Error{ErrorCode::invalid_argument,
                 folder + " exists: a recording never replaces another; choose another --out"};
  }
  Result<std::unique_ptr<Recorder>> recorder = Recorder::open(arguments.recorder);
  if (!recorder) return recorder.error();
  std::fprintf(stderr, "recording to %s until Ctrl-C\n", folder.c_str());
  const Interrupt interrupt;
  const bool terminal = ::isatty(STDERR_FILENO) != 0;
  using Steady = std::chrono::steady_clock;
  const Steady::time_point start = Steady::now();
  Steady::time_point shown = start;
  Result<void> done;
  while (done && !interrupt.requested()) {
    const Steady::time_point now = Steady::now();
    if (arguments.duration_s > 0.0 && std::chrono::duration<double>(now - start).count() >= arguments.duration_s) break;
    done = (*recorder)->step(std::chrono::milliseconds(100));
    if (terminal && now - shown >= std::chrono::seconds(1)) {
      shown = now;
      std::fprintf(stderr, "\r\033[K%s", totals((*recorder)->topics()).c_str());
    }
  }
  if (terminal) std::fputs("\n", stderr);
  const Result<void> closed = (*recorder)->close();
  const std::vector<Recorder::TopicState> topics = (*recorder)->topics();
  std::uint64_t lost = 0, empty = 0;
  for (const Recorder::TopicState& topic : topics) {
    lost += topic.lost;
    empty += !arguments.all && topic.samples == 0 ? 1 : 0;
    std::printf("%-32s %8llu messages %10.3f MB  lost %llu  %s%s%s\n", topic.name.c_str(),
                static_cast<unsigned long long>(topic.samples), static_cast<double>(topic.bytes) * 1e-6,
                static_cast<unsigned long long>(topic.lost), topic.type.c_str(), topic.problem.empty() ? "" : "  ! ",
                topic.problem.c_str());
  }
  std::printf("%s: %s\n", folder.c_str(), totals(topics).c_str());
  if (!done) return done;
  if (!closed) return closed;
  if (empty > 0) return Error{ErrorCode::not_found, std::to_string(empty) + " of the named topics had no message"};
  return {};
}

}  // namespace

void add_record_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  RecorderConfig& recorder = arguments->recorder;
  recorder.participant.name = "adit record";
  CLI::App* command = app.add_subcommand("record", "topics into a ROS 2 bag, as they arrive; any type");
  add_participant_options(*command, recorder.participant);
  command->add_option("topics", recorder.topics, "e.g. /lidar/points /thermal/frame");
  command->add_flag("-a,--all", arguments->all, "every topic, also those that appear later");
  command->add_option("-o,--out", recorder.folder, "the bag's folder, a new one (default: bag_ and the time)");
  command->add_option("--duration", arguments->duration_s, "stop after this time [s] (default: Ctrl-C)");
  command->callback([arguments, &code] {
    if (Result<void> done = record(*arguments); !done) code = fail(done.error());
  });
}

}  // namespace adit
