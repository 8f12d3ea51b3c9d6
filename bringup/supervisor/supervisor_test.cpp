#include "bringup/supervisor/supervisor.hpp"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace adit {
namespace {

using namespace std::chrono_literals;
using State = ChildStatus::State;
using testing::HasSubstr;

// Children are shell scripts. `beat` tells the supervisor that the script is alive, as a component process would.
constexpr const char* beat = "eval \"printf 'beat\\nend\\n' >&$ADIT_SUPERVISOR_FD\"; ";

ChildSpec script(const std::string& name, const std::string& text) {
  ChildSpec spec;
  spec.name = name;
  spec.command = {"/bin/sh", "-c", text};
  spec.restart.backoff = 10ms;
  spec.restart.backoff_max = 40ms;
  spec.stop_timeout = 500ms;
  return spec;
}

class SupervisorTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("adit_supervisor_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string file(const std::string& name) const { return (folder_ / name).string(); }
  std::size_t lines(const std::string& name) const {
    std::ifstream in(file(name));
    std::size_t count = 0;
    for (std::string line; std::getline(in, line);) ++count;
    return count;
  }

  std::filesystem::path folder_;
  std::string log_;
};

TEST_F(SupervisorTest, EndsWellWhenEveryChildDoes) {
  Supervisor supervisor({script("a", "exit 0"), script("b", "exit 0")});
  EXPECT_TRUE(supervisor.run(10s));
  for (const ChildStatus& child : supervisor.status()) EXPECT_EQ(child.state, State::done) << child.name;
}

TEST_F(SupervisorTest, RestartsWithBackOffAndGivesUp) {
  ChildSpec crashing = script("crashing", "echo x >> " + file("starts") + "; exit 3");
  crashing.restart.max = 3;
  Supervisor supervisor({crashing, script("other", "exec sleep 60")});
  supervisor.on_log([this](const std::string& line) { log_ += line + "\n"; });
  EXPECT_FALSE(supervisor.run(10s));
  EXPECT_EQ(lines("starts"), 4u);
  EXPECT_EQ(supervisor.status()[0].state, State::failed);
  EXPECT_EQ(supervisor.status()[1].state, State::done);  // stopped, because the deployment cannot go on
  EXPECT_THAT(log_, HasSubstr("crashing: exit code 3; restart in 10 ms"));
  EXPECT_THAT(log_, HasSubstr("restart in 40 ms"));
  EXPECT_THAT(log_, HasSubstr("given up after 3 restarts"));
}

TEST_F(SupervisorTest, KilledChildComesBackAndOthersGoOn) {
  ChildSpec victim = script("victim", "echo x >> " + file("starts") + "; " + beat + "exec sleep 60");
  ChildSpec done =
      script("done", "while [ $(wc -l < " + file("starts") + " 2>/dev/null || echo 0) -lt 2 ]; do sleep 0.02; done");
  done.stops_all = true;
  Supervisor supervisor({victim, script("other", "echo x >> " + file("other") + "; exec sleep 60"), done});
  bool killed = false;
  supervisor.observe(5ms, [&](const std::vector<ChildStatus>& children) {
    if (killed || children[0].state != State::running) return;
    killed = true;
    ::kill(children[0].pid, SIGKILL);
  });
  supervisor.on_log([this](const std::string& line) { log_ += line + "\n"; });
  EXPECT_TRUE(supervisor.run(20s));
  EXPECT_EQ(supervisor.status()[0].restarts, 1);
  EXPECT_EQ(lines("other"), 1u);
  EXPECT_THAT(log_, HasSubstr("victim: killed by signal 9"));
}

TEST_F(SupervisorTest, StopsAllWhenTheOneThatMattersIsDone) {
  ChildSpec player = script("player", "exit 0");
  player.stops_all = true;
  player.restart.when = RestartPolicy::When::always;
  Supervisor supervisor({script("consumer", "exec sleep 60"), player});
  EXPECT_TRUE(supervisor.run(10s));
  EXPECT_EQ(supervisor.status()[1].restarts, 0);
}

TEST_F(SupervisorTest, SigtermStopsCleanlyAndRestartsNothing) {
  // A child that ends well on SIGTERM, as component processes do.
  Supervisor supervisor({script("a", std::string("trap 'echo stopped >> ") + file("a") + "; exit 0' TERM; " + beat +
                                         "while :; do sleep 0.02; done")});
  bool asked = false;
  supervisor.observe(5ms, [&](const std::vector<ChildStatus>& children) {
    if (asked || children[0].state != State::running) return;
    asked = true;
    ::kill(::getpid(), SIGTERM);
  });
  EXPECT_TRUE(supervisor.run(10s));
  EXPECT_EQ(lines("a"), 1u);
}

TEST_F(SupervisorTest, ChildThatDoesNotStopIsKilledAndCountsAsFailure) {
  Supervisor supervisor({script("stubborn", "trap '' TERM; while :; do sleep 0.02; done")});
  const auto start = std::chrono::steady_clock::now();
  EXPECT_FALSE(supervisor.run(100ms));
  EXPECT_LT(std::chrono::steady_clock::now() - start, 5s);
}

TEST_F(SupervisorTest, SilentChildIsTakenForHungAndRestarted) {
  ChildSpec hung = script("hung", std::string(beat) + "exec sleep 60");
  hung.restart.silent_after = 50ms;
  hung.restart.max = 1;
  Supervisor supervisor({hung});
  EXPECT_FALSE(supervisor.run(10s));
  EXPECT_EQ(supervisor.status()[0].restarts, 1);
  EXPECT_THAT(supervisor.status()[0].last_end, HasSubstr("no heartbeat"));
}

TEST_F(SupervisorTest, ProgramThatDoesNotExistFails) {
  ChildSpec absent = script("absent", "");
  absent.command = {"/nonexistent/program"};
  absent.restart.max = 0;
  Supervisor supervisor({absent});
  EXPECT_FALSE(supervisor.run(10s));
  EXPECT_THAT(supervisor.status()[0].last_end, HasSubstr("exit code 127"));
}

TEST_F(SupervisorTest, RestartMayChangeHowTheChildIsStarted) {
  ChildSpec child = script("child", "exit 1");
  Supervisor supervisor({child});
  supervisor.on_restart([](const ChildStatus& status, ChildSpec& spec) {
    EXPECT_EQ(status.restarts, 1);
    spec.command.back() = "exit 0";
  });
  EXPECT_TRUE(supervisor.run(10s));
}

TEST_F(SupervisorTest, SourcesStartWhenTheOthersAreLinked) {
  ChildSpec source = script("source", "cp " + file("order") + " " + file("seen"));
  source.starts_when_linked = true;
  source.stops_all = true;
  ChildSpec consumer = script("consumer", "sleep 0.2; echo linked > " + file("order") +
                                              "; eval \"printf 'linked\\n' >&$ADIT_SUPERVISOR_FD\"; exec sleep 60");
  Supervisor supervisor({source, consumer});
  EXPECT_TRUE(supervisor.run(20s));
  EXPECT_EQ(lines("seen"), 1u);
}

}  // namespace
}  // namespace adit
