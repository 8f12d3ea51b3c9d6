#include "tests/integration/adit_process.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

namespace adit::integration {
namespace {

using Steady = std::chrono::steady_clock;

Steady::time_point after(double seconds) {
  return Steady::now() + std::chrono::duration_cast<Steady::duration>(std::chrono::duration<double>(seconds));
}

std::string read(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

}  // namespace

Background::Background(const std::vector<std::string>& arguments, const std::string& log_file) {
  std::vector<std::string> words = {ADIT_PROGRAM};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const int log = ::open(log_file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  pid_ = ::fork();
  if (pid_ == 0) {
    ::dup2(log, STDOUT_FILENO);
    ::dup2(log, STDERR_FILENO);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  ::close(log);
}

Background::~Background() {
  if (pid_ <= 0) return;
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, nullptr, 0);
}

void Background::signal(int number) const {
  ::kill(pid_, number);
}

int Background::wait(double limit_s) {
  int status = 0;
  const auto end = after(limit_s);
  while (::waitpid(pid_, &status, WNOHANG) == 0) {
    if (Steady::now() > end) return -1;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  pid_ = -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

Output run_adit(const std::vector<std::string>& arguments, double limit_s) {
  const TemporaryFolder folder;
  const std::string log = folder.file("log");
  Output output;
  {
    Background program(arguments, log);
    output.exit_code = program.wait(limit_s);
  }
  output.text = read(log);
  return output;
}

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "adit_test_XXXXXX").string();
  path_ = ::mkdtemp(name.data());
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::string TemporaryFolder::write(const std::string& name, const std::string& text) const {
  std::ofstream(path_ / name) << text;
  return file(name);
}

std::string private_domain() {
  return std::to_string(101 + ::getpid() % 100);
}

std::vector<pid_t> children_of(pid_t supervisor, const std::string& process) {
  std::vector<pid_t> found;
  std::ifstream list("/proc/" + std::to_string(supervisor) + "/task/" + std::to_string(supervisor) + "/children");
  for (pid_t pid = 0; list >> pid;) {
    const std::string command = read("/proc/" + std::to_string(pid) + "/cmdline");
    const std::string wanted = std::string("--process") + '\0' + process + '\0';
    if (command.find(wanted) != std::string::npos) found.push_back(pid);
  }
  return found;
}

bool wait_until(double limit_s, const std::function<bool()>& holds) {
  for (const auto end = after(limit_s); Steady::now() < end;) {
    if (holds()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return holds();
}

}  // namespace adit::integration
