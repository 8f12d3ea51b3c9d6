#include "components/runtime/heartbeat.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstdlib>

namespace adit {
namespace {

ComponentStatus status(const std::string& name) {
  ComponentStatus component;
  component.name = name;
  component.type = "lidar_odometry";
  component.state = LifecycleState::active;
  component.health = Health::warn;
  component.reason = "few points\nin view";
  component.busy_seconds = 0.25;
  return component;
}

TEST(Heartbeat, ArrivesWholeThroughAPipeInPieces) {
  int fds[2];
  ASSERT_EQ(pipe(fds), 0);
  Heartbeat heartbeat(fds[1], "");
  ASSERT_TRUE(heartbeat.wanted());
  heartbeat.beat("perception", {status("/lidar"), status("/thermal")});
  heartbeat.beat("perception", {});
  std::array<char, 4096> buffer{};
  const ssize_t size = read(fds[0], buffer.data(), buffer.size());
  ASSERT_GT(size, 0);
  HeartbeatParser parser;
  std::vector<HeartbeatReport> reports;
  for (ssize_t i = 0; i < size; i += 7) {
    parser.feed({buffer.data() + i, static_cast<std::size_t>(std::min<ssize_t>(7, size - i))});
    while (auto report = parser.next()) reports.push_back(*report);
  }
  ASSERT_EQ(reports.size(), 2u);
  EXPECT_EQ(reports[0].process, "perception");
  ASSERT_EQ(reports[0].components.size(), 2u);
  EXPECT_EQ(reports[0].components[1].name, "/thermal");
  EXPECT_EQ(reports[0].components[1].state, LifecycleState::active);
  EXPECT_EQ(reports[0].components[1].health, Health::warn);
  EXPECT_EQ(reports[0].components[1].reason, "few points in view");
  EXPECT_DOUBLE_EQ(reports[0].components[1].busy_seconds, 0.25);
  EXPECT_EQ(reports[1].number, 2u);
  close(fds[0]);
  close(fds[1]);
}

TEST(Heartbeat, NeitherBlocksNorTearsWhenNobodyReads) {
  int fds[2];
  ASSERT_EQ(pipe(fds), 0);
  Heartbeat heartbeat(fds[1], "");
  const std::vector<ComponentStatus> many(100, status("/a_component_with_a_rather_long_name"));
  for (int i = 0; i < 100; ++i) heartbeat.beat("perception", many);
  close(fds[1]);
  HeartbeatParser parser;
  std::array<char, 4096> buffer{};
  for (ssize_t size; (size = read(fds[0], buffer.data(), buffer.size())) > 0;) {
    parser.feed({buffer.data(), static_cast<std::size_t>(size)});
  }
  std::uint64_t last = 0;
  while (auto report = parser.next()) last = report->number;
  EXPECT_GT(last, 5u);
  EXPECT_LT(last, 100u);
  close(fds[0]);
}

TEST(Heartbeat, TalksToSystemdAndStopsFeedingItsWatchdogWhenAHandlerIsStuck) {
  const std::string path = "/tmp/adit_heartbeat_test_" + std::to_string(getpid());
  const int server = socket(AF_UNIX, SOCK_DGRAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, path.size());
  ASSERT_EQ(bind(server, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  setenv("WATCHDOG_USEC", "400000", 1);
  Heartbeat heartbeat(-1, path);
  const auto received = [server] {
    std::array<char, 256> buffer{};
    const ssize_t size = recv(server, buffer.data(), buffer.size(), MSG_DONTWAIT);
    return size < 0 ? std::string("nothing") : std::string(buffer.data(), static_cast<std::size_t>(size));
  };
  heartbeat.beat("perception", {});
  EXPECT_EQ(received(), "READY=1\nWATCHDOG=1\n");
  heartbeat.beat("perception", {status("/stuck")});
  EXPECT_EQ(received(), "nothing");
  heartbeat.beat("perception", {});
  EXPECT_EQ(received(), "WATCHDOG=1\n");
  unsetenv("WATCHDOG_USEC");
  close(server);
  unlink(path.c_str());
}

}  // namespace
}  // namespace adit
