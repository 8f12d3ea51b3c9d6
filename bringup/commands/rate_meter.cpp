#include "bringup/commands/rate_meter.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

namespace adit {
namespace {

struct Spread {
  double mean = 0.0, minimum = 0.0, maximum = 0.0, deviation = 0.0;
};

// Precondition: not empty.
Spread spread(const std::vector<double>& values) {
  Spread s;
  s.minimum = *std::min_element(values.begin(), values.end());
  s.maximum = *std::max_element(values.begin(), values.end());
  for (const double v : values) s.mean += v / static_cast<double>(values.size());
  for (const double v : values) s.deviation += (v - s.mean) * (v - s.mean) / static_cast<double>(values.size());
  s.deviation = std::sqrt(s.deviation);
  return s;
}

double seconds(Duration duration) {
  return std::chrono::duration<double>(duration).count();
}

std::string bytes_text(double bytes) {
  const char* const units[] = {"B", "kB", "MB", "GB"};
  int unit = 0;
  for (; bytes >= 1000.0 && unit < 3; ++unit) bytes /= 1000.0;
  char text[32];
  std::snprintf(text, sizeof text, "%.4g %s", bytes, units[unit]);
  return text;
}

}  // namespace

void RateMeter::add(Time arrival, std::size_t bytes, std::optional<Duration> delay) {
  entries_.push_back({arrival, bytes, delay});
  if (entries_.size() > window_) entries_.pop_front();
}

std::string RateMeter::rate() const {
  if (entries_.size() < 2) return "fewer than two messages so far";
  std::vector<double> intervals;
  for (std::size_t i = 1; i < entries_.size(); ++i) {
    intervals.push_back(seconds(entries_[i].arrival - entries_[i - 1].arrival));
  }
  const Spread s = spread(intervals);
  char text[160];
  std::snprintf(text, sizeof text, "average rate %.3f Hz  interval min %.4f s max %.4f s std %.5f s  window %zu",
                s.mean > 0.0 ? 1.0 / s.mean : 0.0, s.minimum, s.maximum, s.deviation, entries_.size());
  return text;
}

std::string RateMeter::bandwidth() const {
  if (entries_.size() < 2) return "fewer than two messages so far";
  std::vector<double> sizes;
  double total = 0.0;
  for (const Entry& entry : entries_) {
    sizes.push_back(static_cast<double>(entry.bytes));
    if (&entry != &entries_.front()) total += sizes.back();
  }
  const double span = seconds(entries_.back().arrival - entries_.front().arrival);
  const Spread s = spread(sizes);
  return bytes_text(span > 0.0 ? total / span : 0.0) + "/s  mean " + bytes_text(s.mean) + "  min " +
         bytes_text(s.minimum) + "  max " + bytes_text(s.maximum) + "  window " + std::to_string(entries_.size());
}

std::string RateMeter::delay() const {
  std::vector<double> delays;
  for (const Entry& entry : entries_) {
    if (entry.delay) delays.push_back(1e3 * seconds(*entry.delay));
  }
  if (delays.empty()) return "no message with a stamp so far";
  const Spread s = spread(delays);
  char text[160];
  std::snprintf(text, sizeof text, "delay mean %.3f ms  min %.3f ms  max %.3f ms  std %.3f ms  window %zu", s.mean,
                s.minimum, s.maximum, s.deviation, delays.size());
  return text;
}

}  // namespace adit
