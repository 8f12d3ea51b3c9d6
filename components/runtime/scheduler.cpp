#include "components/runtime/scheduler.hpp"

namespace adit {

void Scheduler::Queue::push(Strand& strand) {
  strand.next_ = nullptr;
  (first_ ? last_->next_ : first_) = &strand;
  last_ = &strand;
}

Strand& Scheduler::Queue::pop() {
  Strand& strand = *first_;
  first_ = strand.next_;
  strand.next_ = nullptr;
  return strand;
}

void Scheduler::Queue::remove(Strand& strand) {
  Strand* previous = nullptr;
  for (Strand* at = first_; at; previous = at, at = at->next_) {
    if (at != &strand) continue;
    (previous ? previous->next_ : first_) = at->next_;
    if (last_ == at) last_ = previous;
    at->next_ = nullptr;
    return;
  }
}

}  // namespace adit
