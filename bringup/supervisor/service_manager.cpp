#include "bringup/supervisor/service_manager.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>

namespace adit {

ServiceManager::ServiceManager() {
  const char* const given = std::getenv("NOTIFY_SOCKET");
  if (!given || (given[0] != '/' && given[0] != '@') || std::strlen(given) >= sizeof(sockaddr_un::sun_path)) return;
  address_ = given;
  socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  ::unsetenv("NOTIFY_SOCKET");
}

ServiceManager::~ServiceManager() {
  if (socket_ >= 0) ::close(socket_);
}

void ServiceManager::ready() {
  if (ready_) return;
  ready_ = true;
  send("READY=1");
}

void ServiceManager::alive(const std::string& status) {
  send("WATCHDOG=1\nSTATUS=" + status);
}

void ServiceManager::failing(const std::string& status) {
  send("STATUS=" + status);
}

void ServiceManager::stopping() {
  send("STOPPING=1");
}

void ServiceManager::send(const std::string& message) const {
  if (socket_ < 0) return;
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  std::memcpy(to.sun_path, address_.data(), address_.size());
  if (to.sun_path[0] == '@') to.sun_path[0] = '\0';  // the abstract namespace
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address_.size());
  // A manager that does not take it decides by its own watchdog.
  (void)::sendto(socket_, message.data(), message.size(), MSG_NOSIGNAL | MSG_DONTWAIT,
                 reinterpret_cast<const sockaddr*>(&to), length);
}

}  // namespace adit
