// Cyclone's own log: errors and warnings, to the standard error output, or captured while a participant opens.
#pragma once

#include <mutex>
#include <string>

namespace adit::cyclonedds {

// While it lives, what Cyclone logs in this process is collected instead of printed. One at a time: others wait.
class LogCapture {
 public:
  LogCapture();
  ~LogCapture();
  LogCapture(const LogCapture&) = delete;
  LogCapture& operator=(const LogCapture&) = delete;
  // The lines so far, joined by "; ".
  std::string text() const;

 private:
  std::unique_lock<std::mutex> turn_;
};

}  // namespace adit::cyclonedds
