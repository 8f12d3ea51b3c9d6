#include "components/runtime/inline_scheduler.hpp"

namespace adit {

void InlineScheduler::remove(Strand& strand) {
  attached(strand) = false;
  ready_.remove(strand);
  state(strand) = State::idle;
}

void InlineScheduler::schedule(Strand& strand) {
  if (state(strand) == State::running) state(strand) = State::running_again;
  if (state(strand) != State::idle || !attached(strand)) return;
  state(strand) = State::queued;
  ready_.push(strand);
}

void InlineScheduler::run_until_idle() {
  while (!ready_.empty()) {
    Strand& strand = ready_.pop();
    state(strand) = State::running;
    const bool more = strand.run_one();
    const bool again = more || state(strand) == State::running_again;
    state(strand) = State::idle;
    if (again) schedule(strand);
  }
}

}  // namespace adit
