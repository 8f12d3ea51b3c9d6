#include "bringup/evaluation/fusion_log.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>

namespace adit::evaluation {
namespace {

constexpr std::size_t kFixed = 4, kPerSensor = 8;

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> words;
  std::stringstream stream(line);
  for (std::string word; std::getline(stream, word, ',');) words.push_back(word);
  return words;
}

struct Row {
  double stamp_s = 0.0;
  int mode = 0;
};

// One sensor's eight words. False when a number is none.
bool take(const std::vector<std::string>& words, std::size_t at, std::int64_t stamp_ns, FusionLog& log) {
  FusionLog::Sensor* sensor = nullptr;
  for (FusionLog::Sensor& s : log.sensors) {
    if (s.name == words[at]) sensor = &s;
  }
  if (sensor == nullptr) {
    sensor = &log.sensors.emplace_back();
    sensor->name = words[at];
  }
  double v[kPerSensor - 1];
  for (std::size_t i = 0; i + 1 < kPerSensor; ++i) {
    char* end = nullptr;
    v[i] = std::strtod(words[at + 1 + i].c_str(), &end);
    if (end == words[at + 1 + i].c_str() || !std::isfinite(v[i])) return false;
  }
  const auto accepted = static_cast<std::uint64_t>(v[3]), rejected = static_cast<std::uint64_t>(v[4]);
  const bool examined = accepted + rejected != sensor->accepted + sensor->rejected;
  if (examined && v[1] > 0.0) sensor->innovations.push_back({stamp_ns, v[0] / v[1]});
  sensor->mean_nis_per_dof = v[2];
  sensor->accepted = accepted;
  sensor->rejected = rejected;
  sensor->late = static_cast<std::uint64_t>(v[5]);
  sensor->dropped = static_cast<std::uint64_t>(v[6]);
  return true;
}

}  // namespace

Result<FusionLog> read_fusion_log(const std::string& path) {
  std::ifstream file(path);
  if (!file) return Error{ErrorCode::not_found, path + ": cannot read"};
  FusionLog log;
  Row last;
  bool any = false;
  int number = 0;
  for (std::string line; std::getline(file, line);) {
    ++number;
    if (line.empty() || line[0] == '#') continue;
    const std::vector<std::string> words = split(line);
    const auto bad = [&] {
      return Error{ErrorCode::malformed, path + ":" + std::to_string(number) + ": not a line of a fusion log"};
    };
    if (words.size() < kFixed || (words.size() - kFixed) % kPerSensor != 0) return bad();
    const Row row{std::strtod(words[0].c_str(), nullptr), std::atoi(words[1].c_str())};
    if (row.mode < 0 || row.mode >= static_cast<int>(log.mode_s.size())) return bad();
    if (any) log.mode_s[static_cast<std::size_t>(last.mode)] += row.stamp_s - last.stamp_s;
    log.thermal_scale = std::strtod(words[2].c_str(), nullptr);
    log.thermal_scale_sigma = std::strtod(words[3].c_str(), nullptr);
    for (std::size_t at = kFixed; at < words.size(); at += kPerSensor) {
      if (!take(words, at, static_cast<std::int64_t>(std::llround(row.stamp_s * 1e9)), log)) return bad();
    }
    last = row;
    any = true;
  }
  return log;
}

std::vector<std::string> summary_of(const FusionLog& log) {
  std::vector<std::string> lines;
  char text[256];
  std::snprintf(text, sizeof text,
                "fused %.1f s, LiDAR alone %.1f s, thermal alone %.1f s, dead reckoning %.1f s; thermal scale %.4f "
                "+- %.4f",
                log.mode_s[1], log.mode_s[2], log.mode_s[3], log.mode_s[4], log.thermal_scale, log.thermal_scale_sigma);
  lines.emplace_back(text);
  for (const FusionLog::Sensor& s : log.sensors) {
    std::snprintf(text, sizeof text, "%-8s %6llu accepted %5llu rejected %5llu late %5llu dropped, NIS/dof %.2f",
                  s.name.c_str(), static_cast<unsigned long long>(s.accepted),
                  static_cast<unsigned long long>(s.rejected), static_cast<unsigned long long>(s.late),
                  static_cast<unsigned long long>(s.dropped), s.mean_nis_per_dof);
    lines.emplace_back(text);
  }
  return lines;
}

}  // namespace adit::evaluation
