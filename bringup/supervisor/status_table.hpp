// The live table of `adit run`: redrawn in place on a terminal, log lines only elsewhere.
#pragma once

#include <string>
#include <vector>

#include "bringup/supervisor/supervisor.hpp"

namespace adit {

std::string table_text(const std::vector<ChildStatus>& children);

class StatusTable {
 public:
  explicit StatusTable(bool live) : live_(live) {}
  void log(const std::string& line);
  void show(const std::vector<ChildStatus>& children);

 private:
  void erase();
  bool live_;
  std::size_t drawn_lines_ = 0;
  std::string last_;
};

}  // namespace adit
