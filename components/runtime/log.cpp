#include "components/runtime/log.hpp"

#include <fmt/format.h>

#include <iterator>

#include "components/runtime/log_sink.hpp"

namespace adit {
namespace {

constexpr std::string_view level_names[] = {"debug", "info", "warn", "error", "fatal", "off"};

}  // namespace

std::string_view to_string(LogLevel level) {
  return level_names[static_cast<std::size_t>(level)];
}

Result<LogLevel> parse_log_level(std::string_view name) {
  for (std::size_t i = 0; i < std::size(level_names); ++i) {
    if (level_names[i] == name) return static_cast<LogLevel>(i);
  }
  return Error{ErrorCode::invalid_argument,
               "log level '" + std::string(name) + "' is unknown: give debug, info, warn, error, fatal or off"};
}

bool RateLimit::pass(std::uint64_t& suppressed) {
  const std::int64_t now = std::chrono::steady_clock::now().time_since_epoch().count();
  std::int64_t next = next_.load(std::memory_order_relaxed);
  if (now < next || !next_.compare_exchange_strong(next, now + interval_.count(), std::memory_order_relaxed)) {
    held_back_.fetch_add(1, std::memory_order_relaxed);
    return false;
  }
  suppressed = held_back_.exchange(0, std::memory_order_relaxed);
  return true;
}

Logger::Logger(std::string name, LogLevel level, std::shared_ptr<LogSink> sink)
    : name_(std::move(name)), level_(level), sink_(std::move(sink)) {}

Logger::~Logger() = default;

void Logger::write(LogLevel level, fmt::string_view format, fmt::format_args values, std::uint64_t suppressed) {
  fmt::memory_buffer text;
  fmt::vformat_to(std::back_inserter(text), format, values);
  if (suppressed > 0) fmt::format_to(std::back_inserter(text), " ({} more like this suppressed)", suppressed);
  sink_->write(level, name_, {text.data(), text.size()});
}

}  // namespace adit
