// Starts the processes of a deployment, watches them and keeps them running.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bringup/supervisor/restart_policy.hpp"
#include "components/runtime/heartbeat.hpp"

namespace adit {

struct ChildSpec {
  std::string name;
  std::vector<std::string> command;  // argv; the program by path
  std::map<std::string, std::string> environment;
  RestartPolicy restart;
  bool starts_when_linked = false;  // started when all that start at once have reported their links complete
  bool stops_all = false;
  Duration stop_timeout = std::chrono::seconds(5);
};

struct ChildStatus {
  enum class State { waiting_to_start, starting, running, waiting_to_restart, stopping, done, failed };
  std::string name;
  State state = State::waiting_to_start;
  bool linked = false;  // has reported that its links are complete, since it was started
  pid_t pid = 0;        // 0: no process now
  int restarts = 0;
  Duration uptime{};
  double cpu_s = 0.0;         // user + system, all runs of this child
  std::size_t rss_bytes = 0;  // now
  HeartbeatReport report;     // what it last said of itself; number 0: nothing yet
  std::string last_end;       // "exit code 1", "killed by signal 9 (Killed)", "no heartbeat for 5 s"; empty: none yet
};
const char* to_string(ChildStatus::State state);

// What a child sends, once, over its heartbeat socket when its links are complete.
inline constexpr std::string_view links_complete = "linked\n";

// Runs on one thread; blocks SIGCHLD, SIGINT and SIGTERM in it and takes them as events, so create it before other
// threads are started. Children get SIGTERM when the supervisor itself dies.
class Supervisor {
 public:
  using Observer = std::function<void(const std::vector<ChildStatus>&)>;
  // Changes how a child is started the next time, from what it last said of itself: called before each restart.
  using Restore = std::function<void(const ChildStatus&, ChildSpec&)>;
  // A line for the log: what started, ended, why, and what happens next.
  using Log = std::function<void(const std::string&)>;

  explicit Supervisor(std::vector<ChildSpec> children);
  ~Supervisor();
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  void on_log(Log log);
  void on_restart(Restore restore);
  // Called every `period` and at every change of state.
  void observe(Duration period, Observer observer);

  // Starts everything and returns when all is over: a child that stops_all has ended well, SIGINT or SIGTERM came, the
  // duration is over, or nothing is left to run. Children are stopped one
  // after the other in the order of the list, so that a producer ends before its consumers. True when no child failed.
  bool run(std::optional<Duration> limit = {});

  std::vector<ChildStatus> status() const;

 private:
  struct Child;
  using Steady = std::chrono::steady_clock;

  void start(Child& child);
  void start_sources();
  void collect_ended();
  void ended(Child& child, int wait_status);
  void read_reports(Child& child);
  void check_times();
  void begin_stop(const std::string& why);
  void stop_next();
  Steady::time_point next_deadline() const;
  bool all_over() const;
  void log(const std::string& line) const;
  void notify();

  std::vector<std::unique_ptr<Child>> children_;
  int signals_ = -1;
  bool stopping_ = false;
  bool failed_ = false;
  Log log_;
  Restore restore_;
  Observer observer_;
  Duration period_{};
  Steady::time_point next_observation_ = Steady::time_point::max();
  Steady::time_point sources_at_ = Steady::time_point::max();  // started then, linked or not
  Steady::time_point end_ = Steady::time_point::max();
};

}  // namespace adit
