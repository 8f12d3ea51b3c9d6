// Runs the `adit` program and looks at what it does.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace adit::integration {

struct Output {
  int exit_code = -1;  // 128 + signal when killed
  std::string text;    // stdout and stderr together
};

// Runs to the end, at most `limit_s` (then it is killed).
Output run_adit(const std::vector<std::string>& arguments, double limit_s = 60.0);

// A program in the background; killed, if it still runs, when the object goes.
class Background {
 public:
  Background(const std::vector<std::string>& arguments, const std::string& log_file);
  ~Background();
  Background(const Background&) = delete;
  Background& operator=(const Background&) = delete;
  pid_t pid() const { return pid_; }
  void signal(int number) const;
  // The exit code as above; -1 when it does not end within the limit.
  int wait(double limit_s);

 private:
  pid_t pid_ = -1;
};

// A folder that goes with the object.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::string file(const std::string& name) const { return (path_ / name).string(); }
  std::string write(const std::string& name, const std::string& text) const;

 private:
  std::filesystem::path path_;
};

// A DDS domain of this test program alone: tests of other programs may run at the same time.
std::string private_domain();

// The process ids of `adit host` processes that `supervisor` has started, by process name.
std::vector<pid_t> children_of(pid_t supervisor, const std::string& process);

bool wait_until(double limit_s, const std::function<bool()>& holds);

}  // namespace adit::integration
