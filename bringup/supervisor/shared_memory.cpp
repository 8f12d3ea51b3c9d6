#include "bringup/supervisor/shared_memory.hpp"

#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace adit {
namespace {

// "fastrtps_0011223344556677": a participant's segment. Ports ("fastrtps_port7411") and lock files ("..._el") are
// shared by everybody.
bool is_segment(const std::string& name) {
  return name.starts_with("fastrtps_") && !name.starts_with("fastrtps_port") && !name.ends_with("_el");
}

}  // namespace

std::set<std::string> segments_of(const std::string& proc, const std::string& shm, pid_t pid) {
  std::set<std::string> names;
  std::ifstream maps(proc + "/" + std::to_string(pid) + "/maps");
  for (std::string line; std::getline(maps, line);) {
    const std::size_t at = line.find(shm + "/");
    if (at == std::string::npos) continue;
    const std::string name = line.substr(at + shm.size() + 1);
    if (is_segment(name)) names.insert(name);
  }
  return names;
}

std::set<std::string> mapped_segments(const std::string& proc, const std::string& shm) {
  std::set<std::string> names;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(proc, ignored)) {
    const std::string pid = entry.path().filename();
    if (!std::isdigit(static_cast<unsigned char>(pid.front()))) continue;
    names.merge(segments_of(proc, shm, static_cast<pid_t>(std::atoi(pid.c_str()))));
  }
  return names;
}

std::size_t remove_unmapped(const std::set<std::string>& segments, const std::string& proc, const std::string& shm) {
  if (segments.empty()) return 0;
  const std::set<std::string> mapped = mapped_segments(proc, shm);
  std::size_t removed = 0;
  for (const std::string& name : segments) {
    std::error_code ignored;
    if (mapped.contains(name) || !std::filesystem::remove(shm + "/" + name, ignored)) continue;
    std::filesystem::remove(shm + "/" + name + "_el", ignored);
    ++removed;
  }
  return removed;
}

}  // namespace adit
