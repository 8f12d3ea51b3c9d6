#include "bringup/supervisor/service_manager.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <string>

namespace adit {
namespace {

// The manager's end: an abstract socket of this process's own.
class Manager {
 public:
  Manager() : name_("@adit_service_manager_test_" + std::to_string(::getpid())) {
    socket_ = ::socket(AF_UNIX, SOCK_DGRAM, 0);
    sockaddr_un at{};
    at.sun_family = AF_UNIX;
    name_.copy(at.sun_path + 1, name_.size() - 1, 1);
    const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name_.size());
    bound_ = ::bind(socket_, reinterpret_cast<const sockaddr*>(&at), length) == 0;
    ::setenv("NOTIFY_SOCKET", name_.c_str(), 1);
  }
  ~Manager() { ::close(socket_); }
  bool bound() const { return bound_; }
  std::string next() {
    char text[256];
    const ssize_t size = ::recv(socket_, text, sizeof text, MSG_DONTWAIT);
    return size < 0 ? "" : std::string(text, static_cast<std::size_t>(size));
  }

 private:
  std::string name_;
  int socket_ = -1;
  bool bound_ = false;
};

TEST(ServiceManager, SaysReadyOnceFeedsTheWatchdogAndStops) {
  Manager manager;
  ASSERT_TRUE(manager.bound());
  ServiceManager service;
  EXPECT_TRUE(service.listens());
  EXPECT_EQ(std::getenv("NOTIFY_SOCKET"), nullptr) << "processes started later would report too";
  service.ready();
  service.ready();
  service.alive("2 processes");
  service.failing("player: given up");
  service.stopping();
  EXPECT_EQ(manager.next(), "READY=1");
  EXPECT_EQ(manager.next(), "WATCHDOG=1\nSTATUS=2 processes");
  EXPECT_EQ(manager.next(), "STATUS=player: given up");
  EXPECT_EQ(manager.next(), "STOPPING=1");
  EXPECT_EQ(manager.next(), "");
}

TEST(ServiceManager, WithoutAManagerNothingHappens) {
  ::unsetenv("NOTIFY_SOCKET");
  ServiceManager none;
  EXPECT_FALSE(none.listens());
  none.alive("");
  ::setenv("NOTIFY_SOCKET", "relative", 1);
  EXPECT_FALSE(ServiceManager().listens());
  ::setenv("NOTIFY_SOCKET", ("/" + std::string(200, 'x')).c_str(), 1);
  EXPECT_FALSE(ServiceManager().listens());
  ::setenv("NOTIFY_SOCKET", "/nobody/listens", 1);
  ServiceManager gone;
  gone.ready();
  gone.stopping();
  ::unsetenv("NOTIFY_SOCKET");
}

}  // namespace
}  // namespace adit
