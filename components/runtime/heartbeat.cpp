#include "components/runtime/heartbeat.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <utility>

namespace adit {
namespace {

constexpr std::size_t longest_beat = 4096;  // PIPE_BUF: what a pipe takes as one piece

std::string one_line(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text.substr(0, 160);
}

int number_from_environment(const char* name, int otherwise) {
  const char* const text = std::getenv(name);
  if (!text) return otherwise;
  int number = otherwise;
  std::from_chars(text, text + std::strlen(text), number);
  return number;
}

// Writes without blocking, whatever kind of descriptor it is.
void send_all(int fd, const std::string& text) {
  if (send(fd, text.data(), text.size(), MSG_DONTWAIT | MSG_NOSIGNAL) >= 0 || errno != ENOTSOCK) return;
  static_cast<void>(!write(fd, text.data(), text.size()));
}

}  // namespace

Heartbeat Heartbeat::from_environment() {
  const char* const notify = std::getenv("NOTIFY_SOCKET");
  return Heartbeat(number_from_environment("ADIT_SUPERVISOR_FD", -1), notify ? notify : "");
}

Heartbeat::Heartbeat(int supervisor_fd, std::string notify_socket)
    : supervisor_fd_(supervisor_fd), notify_address_(std::move(notify_socket)) {
  if (supervisor_fd_ >= 0) {
    const int flags = fcntl(supervisor_fd_, F_GETFL);
    if (flags < 0 || fcntl(supervisor_fd_, F_SETFL, flags | O_NONBLOCK) < 0) supervisor_fd_ = -1;
    std::signal(SIGPIPE, SIG_IGN);  // a supervisor that died must not take the process with it
    if (flags >= 0) fcntl(supervisor_fd_, F_SETFD, FD_CLOEXEC);
  }
  if (!notify_address_.empty() && notify_address_.size() < sizeof(sockaddr_un::sun_path)) {
    notify_fd_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  }
}

Heartbeat::~Heartbeat() {
  if (notify_fd_ >= 0) close(notify_fd_);
}

Heartbeat::Heartbeat(Heartbeat&& other) noexcept
    : supervisor_fd_(std::exchange(other.supervisor_fd_, -1)),
      notify_fd_(std::exchange(other.notify_fd_, -1)),
      notify_address_(std::move(other.notify_address_)),
      number_(other.number_) {}

void Heartbeat::beat(const std::string& process, const std::vector<ComponentStatus>& components) {
  ++number_;
  if (supervisor_fd_ >= 0) send_all(supervisor_fd_, heartbeat_text({process, number_, components}));
  if (notify_fd_ < 0) return;
  const double limit = 0.5e-6 * number_from_environment("WATCHDOG_USEC", 0);
  const bool stuck = limit > 0 && std::any_of(components.begin(), components.end(),
                                              [&](const ComponentStatus& c) { return c.busy_seconds > limit; });
  std::string text = number_ == 1 ? "READY=1\n" : "";
  if (!stuck) text += "WATCHDOG=1\n";
  if (text.empty()) return;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, notify_address_.data(), notify_address_.size());
  if (address.sun_path[0] == '@') address.sun_path[0] = '\0';
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + notify_address_.size());
  sendto(notify_fd_, text.data(), text.size(), MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&address), length);
}

std::string heartbeat_text(const HeartbeatReport& report) {
  std::string text = fmt::format("process {} {}\n", report.number, one_line(report.process));
  for (const ComponentStatus& component : report.components) {
    const std::string line =
        fmt::format("component {} {} {} {} {} {:.3f} {:.3f} {}\n", component.name, component.type,
                    static_cast<int>(component.state), static_cast<int>(component.health), component.failed ? 1 : 0,
                    component.busy_seconds, component.cpu_seconds, one_line(component.reason));
    if (text.size() + line.size() + 4 > longest_beat) break;
    text += line;
  }
  return text + "end\n";
}

void HeartbeatParser::feed(std::string_view bytes) {
  pending_ += bytes;
}

std::optional<HeartbeatReport> HeartbeatParser::next() {
  std::size_t end;
  while ((end = pending_.find('\n')) != std::string::npos) {
    std::istringstream line(pending_.substr(0, end));
    pending_.erase(0, end + 1);
    std::string kind;
    line >> kind;
    if (kind == "process") {
      building_ = {};
      line >> building_.number;
      std::getline(line >> std::ws, building_.process);
    } else if (kind == "component") {
      ComponentStatus component;
      int state = 0, health = 0;
      line >> component.name >> component.type >> state >> health >> component.failed >> component.busy_seconds >>
          component.cpu_seconds;
      if (!line) continue;
      std::getline(line >> std::ws, component.reason);
      component.state = static_cast<LifecycleState>(std::clamp(state, 1, 4));
      component.health = static_cast<Health>(std::clamp(health, 0, 3));
      building_.components.push_back(std::move(component));
    } else if (kind == "end") {
      return std::exchange(building_, {});
    }
  }
  return {};
}

}  // namespace adit
