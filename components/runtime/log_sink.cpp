#include "components/runtime/log_sink.hpp"

#include <spdlog/sinks/stdout_color_sinks.h>

#include <algorithm>
#include <cstring>

namespace adit {
namespace {

spdlog::level::level_enum to_spdlog(LogLevel level) {
  switch (level) {
    case LogLevel::debug:
      return spdlog::level::debug;
    case LogLevel::info:
      return spdlog::level::info;
    case LogLevel::warn:
      return spdlog::level::warn;
    case LogLevel::error:
      return spdlog::level::err;
    case LogLevel::fatal:
      return spdlog::level::critical;
    case LogLevel::off:
      break;
  }
  return spdlog::level::off;
}

template <std::size_t N>
void copy_cut(std::string_view from, std::array<char, N>& to) {
  const std::size_t size = std::min(from.size(), N - 1);
  std::memcpy(to.data(), from.data(), size);
  to[size] = '\0';
}

}  // namespace

struct LogSink::Console {
  spdlog::sinks::stderr_color_sink_mt sink;
};

LogSink::LogSink(bool console) {
  if (!console) return;
  console_ = std::make_unique<Console>();
  console_->sink.set_pattern("[%H:%M:%S.%e] [%^%l%$] [%n] %v");
}

LogSink::~LogSink() = default;

void LogSink::write(LogLevel level, std::string_view name, std::string_view text) {
  if (console_) {
    const spdlog::details::log_msg message({}, spdlog::string_view_t(name.data(), name.size()), to_spdlog(level),
                                           spdlog::string_view_t(text.data(), text.size()));
    console_->sink.log(message);
    if (level >= LogLevel::error) console_->sink.flush();
  }
  const Time now = system_now();
  const std::lock_guard lock(mutex_);
  if (ring_.empty()) return;
  if (on_record_) on_record_();
  if (count_ == ring_.size()) {
    ++dropped_;
    return;
  }
  LogRecord& record = ring_[(first_ + count_++) % ring_.size()];
  record.stamp = now;
  record.level = level;
  copy_cut(name, record.name);
  copy_cut(text, record.text);
}

void LogSink::keep_records(std::size_t capacity, std::function<void()> on_record) {
  const std::lock_guard lock(mutex_);
  on_record_ = std::move(on_record);
  ring_.assign(capacity, {});
  first_ = count_ = 0;
}

bool LogSink::take(LogRecord& out) {
  const std::lock_guard lock(mutex_);
  if (count_ == 0) return false;
  out = ring_[first_];
  first_ = (first_ + 1) % ring_.size();
  --count_;
  return true;
}

std::uint64_t LogSink::dropped() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

}  // namespace adit
