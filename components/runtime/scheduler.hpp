// Who runs what, when: strands are run by a scheduler, one thread at a time each.
#pragma once

#include <chrono>

namespace adit {

using SteadyTime = std::chrono::steady_clock::time_point;

// A chain of work that never runs concurrently with itself (a component's handlers).
class Strand {
 public:
  virtual ~Strand() = default;
  // Does one piece of work; true when there may be more at once. Must not throw.
  virtual bool run_one() = 0;

 private:
  friend class Scheduler;
  enum class State { idle, queued, running, running_again };
  State state_ = State::idle;
  bool attached_ = false;
  Strand* next_ = nullptr;
  SteadyTime alarm_ = SteadyTime::max();
};

// Runs strands in the order they became ready. Two kinds: Executor (threads) and InlineScheduler (the caller's thread).
class Scheduler {
 public:
  virtual ~Scheduler() = default;
  // Adding and removing happens outside the data path. After remove() returns, the strand does not run any more and
  // schedule() ignores it; must not be called from the strand itself.
  virtual void add(Strand& strand) = 0;
  virtual void remove(Strand& strand) = 0;
  // The strand has work. Any thread; never blocks longer than a short lock, never allocates.
  virtual void schedule(Strand& strand) = 0;
  // Schedules the strand at `time` (replaces its previous alarm; max() is none).
  virtual void set_alarm(Strand& strand, SteadyTime time) = 0;
  // True when no other thread of this scheduler could run a strand while the calling one waits.
  virtual bool would_starve_if_caller_waits() const = 0;

 protected:
  using State = Strand::State;
  static State& state(Strand& strand) { return strand.state_; }
  static bool& attached(Strand& strand) { return strand.attached_; }
  static SteadyTime& alarm(Strand& strand) { return strand.alarm_; }

  // First in, first out, linked through the strands themselves.
  class Queue {
   public:
    bool empty() const { return first_ == nullptr; }
    void push(Strand& strand);
    Strand& pop();
    void remove(Strand& strand);

   private:
    Strand* first_ = nullptr;
    Strand* last_ = nullptr;
  };
};

}  // namespace adit
