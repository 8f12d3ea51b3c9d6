// Logging of a component: formatted only when its level is on, written through spdlog, mirrored to /rosout.
#pragma once

#include <fmt/core.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "idl/result.hpp"

namespace adit {

enum class LogLevel { debug, info, warn, error, fatal, off };
std::string_view to_string(LogLevel level);
Result<LogLevel> parse_log_level(std::string_view name);

// Lets one message through each `interval` and counts the others. Any thread.
class RateLimit {
 public:
  explicit RateLimit(std::chrono::nanoseconds interval) : interval_(interval) {}
  // True: go on; `suppressed` is how many were held back since the last one.
  bool pass(std::uint64_t& suppressed);

 private:
  const std::chrono::nanoseconds interval_;
  std::atomic<std::int64_t> next_{0};
  std::atomic<std::uint64_t> held_back_{0};
};

class LogSink;

// Any thread. Writing does not wait for /rosout; short messages are formatted without the heap.
class Logger {
 public:
  Logger(std::string name, LogLevel level, std::shared_ptr<LogSink> sink);
  ~Logger();
  Logger(const Logger&) = delete;
  Logger& operator=(const Logger&) = delete;

  bool enabled(LogLevel level) const { return level >= level_.load(std::memory_order_relaxed); }
  void set_level(LogLevel level) { level_ = level; }
  const std::string& name() const { return name_; }

  template <class... A>
  void debug(fmt::format_string<A...> format, A&&... values) {
    log(LogLevel::debug, format, std::forward<A>(values)...);
  }
  template <class... A>
  void info(fmt::format_string<A...> format, A&&... values) {
    log(LogLevel::info, format, std::forward<A>(values)...);
  }
  template <class... A>
  void warn(fmt::format_string<A...> format, A&&... values) {
    log(LogLevel::warn, format, std::forward<A>(values)...);
  }
  template <class... A>
  void error(fmt::format_string<A...> format, A&&... values) {
    log(LogLevel::error, format, std::forward<A>(values)...);
  }
  template <class... A>
  void log(LogLevel level, fmt::format_string<A...> format, A&&... values) {
    if (enabled(level)) write(level, format, fmt::make_format_args(values...), 0);
  }
  // log().limited(LogLevel::warn, limit_, "late by {} ms", late): at most one per interval of `limit_`.
  template <class... A>
  void limited(LogLevel level, RateLimit& limit, fmt::format_string<A...> format, A&&... values) {
    std::uint64_t suppressed = 0;
    if (enabled(level) && limit.pass(suppressed)) {
      write(level, format, fmt::make_format_args(values...), suppressed);
    }
  }

 private:
  void write(LogLevel level, fmt::string_view format, fmt::format_args values, std::uint64_t suppressed);

  const std::string name_;
  std::atomic<LogLevel> level_;
  const std::shared_ptr<LogSink> sink_;
};

}  // namespace adit
