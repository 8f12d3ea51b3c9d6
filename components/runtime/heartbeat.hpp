// How a process tells its supervisor that it lives and how its components are, over an inherited file descriptor
// (ADIT_SUPERVISOR_FD: a pipe or socket) and to systemd (NOTIFY_SOCKET, Type=notify).
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "components/runtime/status.hpp"

namespace adit {

// One beat as the supervisor reads it; of ComponentStatus only name, type, state, health, reason, failed and the times.
struct HeartbeatReport {
  std::string process;
  std::uint64_t number = 0;
  std::vector<ComponentStatus> components;
};

// The process's end. Never blocks: a beat that does not fit into the pipe is left out.
class Heartbeat {
 public:
  // Nothing is sent when neither variable is set.
  static Heartbeat from_environment();
  Heartbeat(int supervisor_fd, std::string notify_socket);
  ~Heartbeat();
  Heartbeat(Heartbeat&& other) noexcept;
  Heartbeat& operator=(Heartbeat&&) = delete;

  bool wanted() const { return supervisor_fd_ >= 0 || notify_fd_ >= 0; }
  std::chrono::milliseconds interval() const { return std::chrono::milliseconds(250); }
  // The first beat also tells systemd READY=1. systemd's watchdog is fed only while no handler has been running for
  // longer than half of WATCHDOG_USEC.
  void beat(const std::string& process, const std::vector<ComponentStatus>& components);

 private:
  int supervisor_fd_ = -1;  // inherited, not closed
  int notify_fd_ = -1;
  std::string notify_address_;
  std::uint64_t number_ = 0;
};

// The text of one beat; lines, the last one is "end".
std::string heartbeat_text(const HeartbeatReport& report);

// The supervisor's end: bytes in, whole beats out. Lines it does not know are skipped.
class HeartbeatParser {
 public:
  void feed(std::string_view bytes);
  std::optional<HeartbeatReport> next();

 private:
  std::string pending_;
  HeartbeatReport building_;
};

}  // namespace adit
