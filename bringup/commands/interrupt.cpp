#include "bringup/commands/interrupt.hpp"

#include <csignal>

namespace adit {
namespace {

volatile std::sig_atomic_t interrupted = 0;

void note(int) {
  interrupted = 1;
}

}  // namespace

Interrupt::Interrupt() {
  interrupted = 0;
  previous_int_ = std::signal(SIGINT, note);
  previous_term_ = std::signal(SIGTERM, note);
}

Interrupt::~Interrupt() {
  std::signal(SIGINT, previous_int_);
  std::signal(SIGTERM, previous_term_);
}

bool Interrupt::requested() const {
  return interrupted != 0;
}

}  // namespace adit
