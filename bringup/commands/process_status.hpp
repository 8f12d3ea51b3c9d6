// What a process leaves behind for the summary of a run: written by `adit host`, read by `adit run`.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "components/runtime/process.hpp"
#include "idl/result.hpp"

namespace adit {

struct LinkTotals {
  std::uint64_t sent = 0, received = 0, lost = 0, dropped = 0;
  LinkTotals& operator+=(const LinkTotals& other);
};

struct ProcessStatus {
  std::map<std::string, LinkTotals> links;  // by topic
  std::map<std::string, double> cpu_s;      // by component
};

ProcessStatus summarize(const Process& process);
Result<void> write_process_status(const std::string& path, const ProcessStatus& status);
Result<ProcessStatus> read_process_status(const std::string& path);

}  // namespace adit
