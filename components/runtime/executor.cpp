#include "components/runtime/executor.hpp"

#include <algorithm>

#include "components/runtime/real_time.hpp"

namespace adit {
namespace {

thread_local const Executor* this_threads_executor = nullptr;

}  // namespace

Result<std::unique_ptr<Executor>> Executor::start(const ExecutorConfig& config, const std::string& name,
                                                  std::vector<std::string>& warnings) {
  if (config.threads < 1 || config.threads > 256) {
    return Error{ErrorCode::invalid_argument,
                 "executor '" + name + "': threads is " + std::to_string(config.threads) + ", give 1..256"};
  }
  std::unique_ptr<Executor> executor(new Executor);
  for (int i = 0; i < config.threads; ++i) {
    executor->threads_.emplace_back([self = executor.get()] { self->work(); });
    name_thread(executor->threads_.back(), name);
  }
  std::vector<std::string> refused;
  if (config.lock_memory) lock_memory(refused);
  set_scheduling(executor->threads_, config.priority, config.cpus, name, refused);
  if (config.required && !refused.empty()) return Error{ErrorCode::unavailable, refused.front()};
  warnings.insert(warnings.end(), refused.begin(), refused.end());
  return executor;
}

Executor::~Executor() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  work_or_stop_.notify_all();
}

void Executor::add(Strand& strand) {
  const std::lock_guard lock(mutex_);
  attached(strand) = true;
  strands_.push_back(&strand);
}

void Executor::remove(Strand& strand) {
  std::unique_lock lock(mutex_);
  std::erase(strands_, &strand);
  attached(strand) = false;
  alarm(strand) = SteadyTime::max();
  if (state(strand) == State::queued) {
    ready_.remove(strand);
    state(strand) = State::idle;
  }
  strand_stopped_.wait(lock, [&] { return state(strand) == State::idle; });
}

void Executor::schedule(Strand& strand) {
  bool wake = false;
  {
    const std::lock_guard lock(mutex_);
    if (state(strand) == State::running) state(strand) = State::running_again;
    if (state(strand) != State::idle || !attached(strand)) return;
    enqueue(strand);
    wake = waiting_ > 0;
  }
  if (wake) work_or_stop_.notify_one();
}

void Executor::set_alarm(Strand& strand, SteadyTime time) {
  bool wake_keeper;
  {
    const std::lock_guard lock(mutex_);
    alarm(strand) = time;
    wake_keeper = waiting_ > 0 && (!keeper_ || time < keeper_until_) && time != SteadyTime::max();
  }
  if (wake_keeper) work_or_stop_.notify_all();
}

bool Executor::would_starve_if_caller_waits() const {
  return this_threads_executor == this && threads_.size() == 1;
}

void Executor::enqueue(Strand& strand) {
  state(strand) = State::queued;
  ready_.push(strand);
}

SteadyTime Executor::next_alarm() const {
  SteadyTime next = SteadyTime::max();
  for (Strand* strand : strands_) next = std::min(next, alarm(*strand));
  return next;
}

void Executor::queue_due_strands() {
  if (next_alarm() == SteadyTime::max()) return;
  const SteadyTime now = std::chrono::steady_clock::now();
  for (Strand* strand : strands_) {
    if (alarm(*strand) > now) continue;
    alarm(*strand) = SteadyTime::max();
    if (state(*strand) == State::running) state(*strand) = State::running_again;
    if (state(*strand) == State::idle) enqueue(*strand);
  }
}

// One waiting thread, the keeper, wakes up for the next alarm; the others sleep until there is work.
void Executor::wait(std::unique_lock<std::mutex>& lock) {
  ++waiting_;
  if (const SteadyTime next = next_alarm(); next != SteadyTime::max() && !keeper_) {
    keeper_ = true;
    keeper_until_ = next;
    work_or_stop_.wait_until(lock, next);
    keeper_ = false;
    if (waiting_ > 1) work_or_stop_.notify_one();  // somebody else may have to be the keeper now
  } else {
    work_or_stop_.wait(lock);
  }
  --waiting_;
}

void Executor::work() {
  this_threads_executor = this;
  std::unique_lock lock(mutex_);
  while (!stop_) {
    queue_due_strands();
    if (ready_.empty()) {
      wait(lock);
      continue;
    }
    Strand& strand = ready_.pop();
    state(strand) = State::running;
    if (!ready_.empty() && waiting_ > 0) work_or_stop_.notify_one();
    lock.unlock();
    const bool more = strand.run_one();
    lock.lock();
    if (attached(strand) && (more || state(strand) == State::running_again)) {
      enqueue(strand);
    } else {
      state(strand) = State::idle;
      if (!attached(strand)) strand_stopped_.notify_all();
    }
  }
}

}  // namespace adit
