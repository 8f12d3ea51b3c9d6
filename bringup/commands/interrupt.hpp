// Ctrl-C and SIGTERM as a question, for commands that run until they are stopped.
#pragma once

namespace adit {

// From construction to destruction the two signals do not end the process; requested() then says whether one came. One
// object at a time.
class Interrupt {
 public:
  Interrupt();
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  bool requested() const;

 private:
  void (*previous_int_)(int);
  void (*previous_term_)(int);
};

}  // namespace adit
