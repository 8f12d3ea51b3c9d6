#include "bringup/supervisor/supervisor.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <set>
#include <sstream>

#include "bringup/supervisor/shared_memory.hpp"

namespace adit {

struct Supervisor::Child {
  ChildSpec spec;
  ChildStatus status;
  int reports = -1;  // our end of its heartbeat socket
  HeartbeatParser parser;
  bool hung = false;
  std::set<std::string> segments;  // shared memory it was seen to use
  Steady::time_point started{};
  Steady::time_point last_report{};
  Steady::time_point restart_at = Steady::time_point::max();
  Steady::time_point kill_at = Steady::time_point::max();
  int restarts_in_a_row = 0;
  double cpu_of_ended_runs = 0.0;

  bool alive() const { return status.pid > 0; }
  bool over() const { return status.state == ChildStatus::State::done || status.state == ChildStatus::State::failed; }
};

namespace {

using State = ChildStatus::State;

std::string describe_end(int wait_status) {
  if (WIFEXITED(wait_status)) return "exit code " + std::to_string(WEXITSTATUS(wait_status));
  const int number = WTERMSIG(wait_status);
  return "killed by signal " + std::to_string(number) + " (" + ::strsignal(number) + ")";
}

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

// CPU seconds and resident bytes of a living process, from /proc.
void read_usage(pid_t pid, double& cpu_s, std::size_t& rss_bytes) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  std::string line;
  if (!std::getline(file, line)) return;
  // The name in parentheses may hold anything; the fields after it are numbers, from field 3 on.
  std::istringstream fields(line.substr(line.rfind(')') + 2));
  std::string field;
  long long value[22] = {};
  fields >> field;
  for (int i = 1; i < 22 && fields >> value[i]; ++i) {
  }
  cpu_s = static_cast<double>(value[11] + value[12]) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  rss_bytes = static_cast<std::size_t>(value[21]) * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

// In the child, between fork and exec: nothing but system calls.
[[noreturn]] void become(char* const* command, char* const* environment, pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(127);  // the supervisor died in between
  sigset_t none;
  ::sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  // A terminal's Ctrl-C goes to the supervisor only, which then stops its children in order.
  ::setpgid(0, 0);
  ::execve(command[0], command, environment);
  ::_exit(127);
}

}  // namespace

const char* to_string(ChildStatus::State state) {
  switch (state) {
    case State::waiting_to_start:
      return "waiting";
    case State::starting:
      return "starting";
    case State::running:
      return "running";
    case State::waiting_to_restart:
      return "waiting";
    case State::stopping:
      return "stopping";
    case State::done:
      return "done";
    case State::failed:
      return "FAILED";
  }
  return "?";
}

Supervisor::Supervisor(std::vector<ChildSpec> children) {
  for (ChildSpec& spec : children) {
    auto child = std::make_unique<Child>();
    child->status.name = spec.name;
    child->spec = std::move(spec);
    children_.push_back(std::move(child));
  }
  sigset_t set;
  ::sigemptyset(&set);
  for (const int number : {SIGCHLD, SIGINT, SIGTERM}) ::sigaddset(&set, number);
  ::pthread_sigmask(SIG_BLOCK, &set, nullptr);
  signals_ = ::signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
}

Supervisor::~Supervisor() {
  for (const auto& child : children_) {
    if (child->alive()) {
      ::kill(child->status.pid, SIGKILL);
      ::waitpid(child->status.pid, nullptr, 0);
    }
    if (child->reports >= 0) ::close(child->reports);
  }
  ::close(signals_);
}

void Supervisor::on_log(Log log) {
  log_ = std::move(log);
}

void Supervisor::on_restart(Restore restore) {
  restore_ = std::move(restore);
}

void Supervisor::observe(Duration period, Observer observer) {
  period_ = period;
  observer_ = std::move(observer);
  next_observation_ = Steady::now() + period;
}

bool Supervisor::run(std::optional<Duration> limit) {
  if (limit) end_ = Steady::now() + *limit;
  constexpr auto longest_wait_for_links = std::chrono::seconds(15);
  sources_at_ = Steady::now() + longest_wait_for_links;
  for (const auto& child : children_) {
    if (!child->spec.starts_when_linked) start(*child);
  }
  while (!all_over()) {
    std::vector<pollfd> watched = {{signals_, POLLIN, 0}};
    for (const auto& child : children_) watched.push_back({child->reports, POLLIN, 0});  // poll skips negative ones
    const auto wait = std::chrono::ceil<std::chrono::milliseconds>(next_deadline() - Steady::now());
    ::poll(watched.data(), watched.size(), static_cast<int>(std::clamp<long>(wait.count(), 0, 60'000)));

    signalfd_siginfo info{};
    while (::read(signals_, &info, sizeof info) == sizeof info) {
      if (info.ssi_signo != SIGCHLD) begin_stop(std::string("got ") + ::strsignal(static_cast<int>(info.ssi_signo)));
    }
    for (const auto& child : children_) read_reports(*child);
    collect_ended();
    start_sources();
    check_times();
    if (stopping_) stop_next();
  }
  notify();
  return !failed_;
}

void Supervisor::start_sources() {
  if (stopping_ || sources_at_ == Steady::time_point::max()) return;
  const bool linked = std::all_of(children_.begin(), children_.end(), [](const auto& child) {
    return child->spec.starts_when_linked || child->status.linked || child->over();
  });
  if (!linked && Steady::now() < sources_at_) return;
  for (const auto& child : children_) {
    if (child->status.state != State::waiting_to_start) continue;
    if (!linked) log(child->spec.name + ": started although not every link of the other processes is matched");
    start(*child);
  }
  sources_at_ = Steady::time_point::max();
}

void Supervisor::start(Child& child) {
  int sockets[2] = {-1, -1};
  ::socketpair(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, sockets);
  ::fcntl(sockets[1], F_SETFD, 0);  // the child inherits its end

  std::vector<std::string> variables;
  for (char** variable = environ; *variable; ++variable) variables.emplace_back(*variable);
  for (const auto& [name, value] : child.spec.environment) variables.push_back(name + "=" + value);
  variables.push_back("ADIT_SUPERVISOR_FD=" + std::to_string(sockets[1]));
  std::vector<char*> environment, command;
  for (std::string& variable : variables) environment.push_back(variable.data());
  for (std::string& word : child.spec.command) command.push_back(word.data());
  environment.push_back(nullptr);
  command.push_back(nullptr);

  const pid_t parent = ::getpid();
  const pid_t pid = ::fork();
  if (pid == 0) become(command.data(), environment.data(), parent);
  ::close(sockets[1]);
  child.reports = sockets[0];
  child.started = child.last_report = Steady::now();
  child.restart_at = child.kill_at = Steady::time_point::max();
  child.hung = false;
  child.status.pid = pid;
  child.status.state = State::starting;
  child.status.linked = false;
  child.parser = {};
  if (pid < 0) {
    child.status.pid = 0;
    child.status.state = State::failed;
    child.status.last_end = std::string("cannot fork: ") + std::strerror(errno);
    failed_ = true;
    log(child.spec.name + ": " + child.status.last_end);
    begin_stop(child.spec.name + " could not be started");
    return;
  }
  log(child.spec.name + ": started, pid " + std::to_string(pid));
  notify();
}

void Supervisor::read_reports(Child& child) {
  if (child.reports < 0) return;
  char text[8192];
  for (ssize_t size = 0; (size = ::recv(child.reports, text, sizeof text, 0)) > 0;) {
    child.last_report = Steady::now();
    if (std::string_view(text, static_cast<std::size_t>(size)) == links_complete) {
      child.status.linked = true;
      continue;
    }
    if (child.status.report.number % 16 == 0) child.segments.merge(segments_of("/proc", "/dev/shm", child.status.pid));
    child.parser.feed({text, static_cast<std::size_t>(size)});
    while (std::optional<HeartbeatReport> report = child.parser.next()) child.status.report = *std::move(report);
    if (child.status.state != State::starting) continue;
    child.status.state = State::running;
    notify();
  }
}

void Supervisor::collect_ended() {
  for (const auto& child : children_) {
    if (!child->alive()) continue;
    int status = 0;
    rusage usage{};
    if (::wait4(child->status.pid, &status, WNOHANG, &usage) != child->status.pid) continue;
    child->cpu_of_ended_runs += seconds(usage.ru_utime) + seconds(usage.ru_stime);
    child->status.cpu_s = child->cpu_of_ended_runs;
    ended(*child, status);
  }
}

void Supervisor::ended(Child& child, int wait_status) {
  const bool well = WIFEXITED(wait_status) && WEXITSTATUS(wait_status) == 0;
  read_reports(child);
  ::close(child.reports);
  child.reports = -1;
  child.status.pid = 0;
  child.status.rss_bytes = 0;
  child.status.last_end = child.hung ? "no heartbeat, killed" : describe_end(wait_status);
  if (!well) {
    const std::size_t removed = remove_unmapped(child.segments, "/proc", "/dev/shm");
    if (removed > 0)
      log(child.spec.name + ": removed " + std::to_string(removed) + " shared-memory segments it left behind");
  }
  child.segments.clear();
  const auto now = Steady::now();
  if (now - child.started >= child.spec.restart.healthy_after) child.restarts_in_a_row = 0;

  const bool stopped_by_us = stopping_;
  const bool restart = !stopped_by_us && !(well && child.spec.stops_all) &&
                       (child.spec.restart.when == RestartPolicy::When::always ||
                        (child.spec.restart.when == RestartPolicy::When::on_failure && !well));
  if (restart && (child.spec.restart.max < 0 || child.restarts_in_a_row < child.spec.restart.max)) {
    const int doublings = std::min(child.restarts_in_a_row, 20);
    const Duration backoff =
        std::min(child.spec.restart.backoff * (std::int64_t{1} << doublings), child.spec.restart.backoff_max);
    ++child.restarts_in_a_row;
    ++child.status.restarts;
    child.status.state = State::waiting_to_restart;
    child.restart_at = now + backoff;
    log(child.spec.name + ": " + child.status.last_end + "; restart in " +
        std::to_string(std::chrono::duration_cast<std::chrono::milliseconds>(backoff).count()) + " ms");
  } else if (well || (stopped_by_us && !child.hung && WIFSIGNALED(wait_status) && WTERMSIG(wait_status) == SIGTERM)) {
    child.status.state = State::done;
    log(child.spec.name + ": done");
    if (child.spec.stops_all && !stopping_) begin_stop(child.spec.name + " is done");
  } else {
    child.status.state = State::failed;
    failed_ = true;
    log(child.spec.name + ": " + child.status.last_end +
        (restart ? "; given up after " + std::to_string(child.restarts_in_a_row) + " restarts" : ""));
    if (!stopping_) begin_stop(child.spec.name + " failed");
  }
  notify();
}

void Supervisor::check_times() {
  const auto now = Steady::now();
  if (now >= end_ && !stopping_) begin_stop("the time is over");
  for (const auto& child : children_) {
    if (child->status.state == State::waiting_to_restart && !stopping_ && now >= child->restart_at) {
      if (restore_) restore_(child->status, child->spec);
      start(*child);
    }
    if (!child->alive()) continue;
    const Duration silent_after = child->spec.restart.silent_after;
    const bool watched = silent_after > Duration::zero() && child->status.state == State::running;
    if (watched && now - child->last_report > silent_after) {
      child->hung = true;
      child->last_report = now;  // one kill is enough
      log(child->spec.name + ": no heartbeat for " +
          std::to_string(std::chrono::duration_cast<std::chrono::milliseconds>(silent_after).count()) +
          " ms, killing it");
      ::kill(child->status.pid, SIGKILL);
    }
    if (now >= child->kill_at) {
      log(child->spec.name + ": did not stop in time, killing it");
      failed_ = true;
      child->kill_at = Steady::time_point::max();
      ::kill(child->status.pid, SIGKILL);
    }
  }
  if (now >= next_observation_) {
    next_observation_ = now + period_;
    notify();
  }
}

void Supervisor::begin_stop(const std::string& why) {
  if (stopping_) return;
  stopping_ = true;
  log("stopping: " + why);
  for (const auto& child : children_) {
    if (!child->alive() && !child->over()) child->status.state = State::done;
  }
}

// Consumers are usually listed after producers: stopping in reverse, one after the other, would lose what is still on
// its way. So producers stop first, in the order of the file, and each may drain.
void Supervisor::stop_next() {
  for (const auto& child : children_) {
    if (!child->alive()) continue;
    if (child->status.state != State::stopping) {
      child->status.state = State::stopping;
      child->kill_at = Steady::now() + child->spec.stop_timeout;
      ::kill(child->status.pid, SIGTERM);
      notify();
    }
    return;
  }
}

Supervisor::Steady::time_point Supervisor::next_deadline() const {
  auto next = std::min(next_observation_, stopping_ ? Steady::time_point::max() : std::min(end_, sources_at_));
  for (const auto& child : children_) {
    if (child->status.state == State::waiting_to_restart) next = std::min(next, child->restart_at);
    if (!child->alive()) continue;
    next = std::min(next, child->kill_at);
    if (child->spec.restart.silent_after > Duration::zero() && child->status.state == State::running) {
      next = std::min(next, child->last_report + child->spec.restart.silent_after + std::chrono::milliseconds(1));
    }
  }
  return std::min(next, Steady::now() + std::chrono::seconds(60));
}

bool Supervisor::all_over() const {
  return std::all_of(children_.begin(), children_.end(), [](const auto& child) { return child->over(); });
}

void Supervisor::log(const std::string& line) const {
  if (log_) log_(line);
}

void Supervisor::notify() {
  if (observer_) observer_(status());
}

std::vector<ChildStatus> Supervisor::status() const {
  std::vector<ChildStatus> list;
  for (const auto& child : children_) {
    ChildStatus status = child->status;
    if (child->alive()) {
      status.uptime = Steady::now() - child->started;
      double cpu = 0.0;
      read_usage(status.pid, cpu, status.rss_bytes);
      status.cpu_s = child->cpu_of_ended_runs + cpu;
    }
    list.push_back(std::move(status));
  }
  return list;
}

}  // namespace adit
