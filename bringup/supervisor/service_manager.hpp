// Reports to the service manager (systemd, Type=notify with WatchdogSec=) when one started this process: the protocol
// of sd_notify(3), a datagram to $NOTIFY_SOCKET. Without one every call does nothing.
#pragma once

#include <string>

namespace adit {

class ServiceManager {
 public:
  // Takes the address out of the environment, so that processes started later do not report in this one's name.
  ServiceManager();
  ~ServiceManager();
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  bool listens() const { return socket_ >= 0; }
  void ready();                             // once; later calls are not sent
  void alive(const std::string& status);    // feeds the watchdog; `status` is what `systemctl status` shows
  void failing(const std::string& status);  // shows it and leaves the watchdog hungry
  void stopping();

 private:
  void send(const std::string& message) const;

  int socket_ = -1;
  std::string address_;
  bool ready_ = false;
};

}  // namespace adit
