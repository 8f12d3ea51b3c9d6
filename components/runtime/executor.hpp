// Threads that run components, with real-time settings where the deployment asks for them.
#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "components/runtime/scheduler.hpp"
#include "idl/result.hpp"

namespace adit {

struct ExecutorConfig {
  int threads = 1;
  int priority = 0;            // SCHED_FIFO 1..99; 0 = normal scheduling
  std::vector<int> cpus = {};  // the threads run only on these; empty = anywhere
  bool lock_memory = false;    // mlockall: no page faults once memory was touched
  bool required = false;       // refuse to start without the settings above, instead of warning
};

// A fixed number of threads. Destroy it after every strand was removed.
class Executor final : public Scheduler {
 public:
  // What the system refused (no permission, no such CPU) goes to `warnings`, each with the remedy; when
  // config.required it is an error instead.
  static Result<std::unique_ptr<Executor>> start(const ExecutorConfig& config, const std::string& name,
                                                 std::vector<std::string>& warnings);
  ~Executor();
  Executor(const Executor&) = delete;
  Executor& operator=(const Executor&) = delete;

  void add(Strand& strand) override;
  void remove(Strand& strand) override;
  void schedule(Strand& strand) override;
  void set_alarm(Strand& strand, SteadyTime time) override;
  bool would_starve_if_caller_waits() const override;

 private:
  Executor() = default;
  void work();
  void enqueue(Strand& strand);
  void queue_due_strands();
  SteadyTime next_alarm() const;
  void wait(std::unique_lock<std::mutex>& lock);

  std::mutex mutex_;
  std::condition_variable work_or_stop_;
  std::condition_variable strand_stopped_;
  Queue ready_;
  std::vector<Strand*> strands_;
  std::size_t waiting_ = 0;
  SteadyTime keeper_until_ = SteadyTime::max();  // when the thread that watches the alarms wakes up
  bool keeper_ = false;
  bool stop_ = false;
  std::vector<std::jthread> threads_;
};

}  // namespace adit
