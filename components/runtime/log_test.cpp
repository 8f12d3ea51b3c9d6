#include "components/runtime/log.hpp"

#include <gtest/gtest.h>

#include <string>

#include "components/runtime/log_sink.hpp"

namespace adit {
namespace {

TEST(Log, FormatsAndKeepsRecordsOfItsLevel) {
  const auto sink = std::make_shared<LogSink>(false);
  sink->keep_records(10);
  Logger log("lidar", LogLevel::info, sink);
  log.debug("not {}", "me");
  log.warn("{} points, {:.1f} m", 3, 2.5);
  LogRecord record;
  ASSERT_TRUE(sink->take(record));
  EXPECT_STREQ(record.text.data(), "3 points, 2.5 m");
  EXPECT_STREQ(record.name.data(), "lidar");
  EXPECT_EQ(record.level, LogLevel::warn);
  EXPECT_FALSE(sink->take(record));
}

TEST(Log, CutsLongTextsAndCountsWhatDoesNotFit) {
  const auto sink = std::make_shared<LogSink>(false);
  sink->keep_records(2);
  Logger log("lidar", LogLevel::debug, sink);
  for (int i = 0; i < 5; ++i) log.info("{}", std::string(10'000, 'x'));
  LogRecord record;
  ASSERT_TRUE(sink->take(record));
  EXPECT_EQ(std::string(record.text.data()).size(), record.text.size() - 1);
  EXPECT_EQ(sink->dropped(), 3u);
}

TEST(Log, ARateLimitLetsOneThroughAndCountsTheOthers) {
  const auto sink = std::make_shared<LogSink>(false);
  sink->keep_records(10);
  Logger log("lidar", LogLevel::info, sink);
  RateLimit limit(std::chrono::milliseconds(20));
  for (int i = 0; i < 4; ++i) log.limited(LogLevel::warn, limit, "late {}", i);
  const auto start = std::chrono::steady_clock::now();
  while (std::chrono::steady_clock::now() - start < std::chrono::milliseconds(21)) {
  }
  log.limited(LogLevel::warn, limit, "late {}", 4);
  LogRecord record;
  ASSERT_TRUE(sink->take(record));
  EXPECT_STREQ(record.text.data(), "late 0");
  ASSERT_TRUE(sink->take(record));
  EXPECT_STREQ(record.text.data(), "late 4 (3 more like this suppressed)");
}

TEST(Log, LevelsHaveNames) {
  EXPECT_EQ(*parse_log_level("warn"), LogLevel::warn);
  const auto unknown = parse_log_level("loud");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().message, "log level 'loud' is unknown: give debug, info, warn, error, fatal or off");
}

}  // namespace
}  // namespace adit
