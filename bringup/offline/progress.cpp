#include "bringup/offline/progress.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace adit::offline {

Progress::Progress(std::string label, Time begin, Time end)
    : label_(std::move(label)),
      begin_(begin),
      whole_(std::max(Duration(1), end - begin)),
      terminal_(::isatty(STDERR_FILENO) != 0) {}

void Progress::at(Time now) {
  const double share =
      std::clamp(static_cast<double>((now - begin_).count()) / static_cast<double>(whole_.count()), 0.0, 1.0);
  const int step = static_cast<int>(share * (terminal_ ? 200.0 : 10.0));
  if (step <= shown_) return;
  shown_ = step;
  const double elapsed = std::chrono::duration<double>(Steady::now() - start_).count();
  const double left = elapsed * (1.0 / share - 1.0);
  if (!terminal_) {
    std::fprintf(stderr, "%s: %3.0f %%, %.0f s left\n", label_.c_str(), 100.0 * share, left);
    return;
  }
  constexpr int width = 40;
  const int full = static_cast<int>(share * width);
  std::fprintf(stderr, "\r%s [%.*s%*s] %3.0f %%  %.0f s left   ", label_.c_str(), full,
               "########################################", width - full, "", 100.0 * share, left);
}

void Progress::done() const {
  if (terminal_) std::fprintf(stderr, "\r\033[K");
}

}  // namespace adit::offline
