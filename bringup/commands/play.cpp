#include <unistd.h>

#include <cstdio>

#include "bringup/commands/command.hpp"
#include "bringup/commands/interrupt.hpp"
#include "bringup/recording/player.hpp"

namespace adit {
namespace {

struct Arguments {
  PlayerConfig player;
  std::vector<std::string> remaps;
  double duration_s = 0.0;  // 0: to the end
  double wait_s = 1.0;
};

Result<void> play(Arguments& arguments) {
  PlayerConfig& config = arguments.player;
  if (arguments.duration_s > 0.0) config.duration_s = arguments.duration_s;
  for (const std::string& remap : arguments.remaps) {
    const std::size_t between = remap.find(":=");
    if (between == std::string::npos) {
      return Error{ErrorCode::invalid_argument, "--remap " + remap + ": expected FROM:=TO"};
    }
    config.remap[remap.substr(0, between)] = remap.substr(between + 2);
  }
  Result<std::unique_ptr<Player>> player = Player::open(config);
  if (!player) return player.error();
  (*player)->wait_for_readers(Duration(static_cast<std::int64_t>(arguments.wait_s * 1e9)));
  const Interrupt interrupt;
  const bool terminal = ::isatty(STDERR_FILENO) != 0;
  const double length_s = std::chrono::duration<double>((*player)->length()).count();
  auto shown = std::chrono::steady_clock::now();
  const Result<void> done = (*player)->run([&](Duration since_start) {
    const auto now = std::chrono::steady_clock::now();
    if (terminal && now - shown >= std::chrono::milliseconds(500)) {
      shown = now;
      std::fprintf(stderr, "\r\033[K%.1f / %.1f s, %llu messages", std::chrono::duration<double>(since_start).count(),
                   length_s, static_cast<unsigned long long>((*player)->counts().sent));
    }
    return !interrupt.requested();
  });
  if (terminal) std::fputs("\n", stderr);
  const Player::Counts& counts = (*player)->counts();
  std::printf("%llu messages, %.1f MB sent, %llu refused, at most %.1f ms behind their time\n",
              static_cast<unsigned long long>(counts.sent), static_cast<double>(counts.bytes) * 1e-6,
              static_cast<unsigned long long>(counts.refused),
              std::chrono::duration<double, std::milli>(counts.latest).count());
  if (!done) return done;
  if (counts.refused > 0) {
    return Error{ErrorCode::timeout,
                 std::to_string(counts.refused) +
                     " messages were refused: a reliable reader does not keep up; see adit topic info"};
  }
  return {};
}

}  // namespace

void add_play_command(CLI::App& app, ExitCode& code) {
  auto arguments = std::make_shared<Arguments>();
  PlayerConfig& player = arguments->player;
  player.participant.name = "adit play";
  CLI::App* command = app.add_subcommand("play", "a ROS 2 bag (SQLite) as live topics, with their recorded QoS");
  add_participant_options(*command, player.participant);
  command->add_option("bag", player.bag, "folder or .db3 file")->required()->check(CLI::ExistingPath);
  command->add_option("--topic", player.topics, "only this topic (repeatable)");
  command->add_option("--remap", arguments->remaps, "FROM:=TO, send a topic under another name (repeatable)");
  command->add_option("-r,--rate", player.rate, "times real time")->check(CLI::PositiveNumber)->capture_default_str();
  command->add_option("--start", player.start_s, "begin here [s]")->check(CLI::NonNegativeNumber);
  command->add_option("--duration", arguments->duration_s, "stop after this time of the bag [s]");
  command->add_flag("-l,--loop", player.loop, "over and over, until Ctrl-C");
  command->add_option("--clock", player.clock_hz, "publish the bag's time on /clock at this rate [Hz]");
  command->add_option("--wait", arguments->wait_s, "longest time to wait for readers before the first message [s]")
      ->capture_default_str();
  command->callback([arguments, &code] {
    if (Result<void> done = play(*arguments); !done) code = fail(done.error());
  });
}

}  // namespace adit
