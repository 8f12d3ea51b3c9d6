#include "bringup/supervisor/status_table.hpp"

#include <algorithm>
#include <cstdio>

namespace adit {

std::string table_text(const std::vector<ChildStatus>& children) {
  std::string text;
  char line[256];
  std::snprintf(line, sizeof line, "%-18s %-9s %8s %9s %9s %8s %9s\n", "process", "state", "pid", "restarts", "up [s]",
                "CPU [s]", "RSS [MB]");
  text += line;
  for (const ChildStatus& child : children) {
    std::snprintf(
        line, sizeof line, "%-18s %-9s %8d %9d %9.1f %8.2f %9.1f%s%s\n", child.name.c_str(), to_string(child.state),
        static_cast<int>(child.pid), child.restarts, std::chrono::duration<double>(child.uptime).count(), child.cpu_s,
        static_cast<double>(child.rss_bytes) / 1e6, child.last_end.empty() ? "" : "  last: ", child.last_end.c_str());
    text += line;
    for (const ComponentStatus& component : child.report.components) {
      std::snprintf(line, sizeof line, "  %-24s %-12s %-6s CPU %.2f s  %s\n", component.name.c_str(),
                    std::string(to_string(component.state)).c_str(), std::string(to_string(component.health)).c_str(),
                    component.cpu_seconds, component.reason.c_str());
      text += line;
    }
  }
  return text;
}

void StatusTable::log(const std::string& line) {
  erase();
  std::printf("%s\n", line.c_str());
  if (live_) {
    std::fputs(last_.c_str(), stdout);
    drawn_lines_ = static_cast<std::size_t>(std::count(last_.begin(), last_.end(), '\n'));
  }
  std::fflush(stdout);
}

void StatusTable::show(const std::vector<ChildStatus>& children) {
  if (!live_) return;
  erase();
  last_ = table_text(children);
  std::fputs(last_.c_str(), stdout);
  std::fflush(stdout);
  drawn_lines_ = static_cast<std::size_t>(std::count(last_.begin(), last_.end(), '\n'));
}

void StatusTable::erase() {
  if (drawn_lines_ > 0) std::printf("\033[%zuA\033[J", drawn_lines_);
  drawn_lines_ = 0;
}

}  // namespace adit
