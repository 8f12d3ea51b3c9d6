// Where the loggers of a process write: the console through spdlog, and a bounded queue that /rosout is fed from.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string_view>
#include <vector>

#include "components/runtime/log.hpp"
#include "middleware/time.hpp"

namespace adit {

// Text of fixed size, so that a record can be kept without the heap. What does not fit is cut.
struct LogRecord {
  Time stamp{};
  LogLevel level{};
  std::array<char, 64> name{};
  std::array<char, 448> text{};
};

// Thread-safe.
class LogSink {
 public:
  explicit LogSink(bool console = true);
  ~LogSink();

  void write(LogLevel level, std::string_view name, std::string_view text);
  // Keeps up to `capacity` records for take() from now on; more are dropped and counted. `on_record` is called for each
  // one, on the thread that logs: signal somebody and return, and do not log. When this returns, the previous one is
  // not running and will not be called again.
  void keep_records(std::size_t capacity, std::function<void()> on_record = nullptr);
  bool take(LogRecord& out);
  std::uint64_t dropped() const;

 private:
  struct Console;
  std::unique_ptr<Console> console_;
  mutable std::mutex mutex_;
  std::function<void()> on_record_;
  std::vector<LogRecord> ring_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  std::uint64_t dropped_ = 0;
};

}  // namespace adit
