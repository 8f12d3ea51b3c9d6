#include "middleware/cyclonedds/log.hpp"

#include <dds/ddsrt/log.h>

#include <cstdio>

namespace adit::cyclonedds {
namespace {

std::mutex turn_mutex;     // one LogCapture at a time
std::mutex capture_mutex;  // guards the two below
bool capturing = false;
std::string captured;

void write_log(void*, const dds_log_data_t* data) {
  std::string line(data->message, data->size);
  while (!line.empty() && (line.back() == '\n' || line.back() == ' ')) line.pop_back();
  {
    const std::lock_guard lock(capture_mutex);
    if (capturing) {
      captured += (captured.empty() ? "" : "; ") + line;
      return;
    }
  }
  std::fprintf(stderr, "cyclonedds: %s\n", line.c_str());
}

}  // namespace

LogCapture::LogCapture() : turn_(turn_mutex) {
  static const bool installed = (dds_set_log_sink(write_log, nullptr), true);
  static_cast<void>(installed);
  const std::lock_guard lock(capture_mutex);
  capturing = true;
  captured.clear();
}

LogCapture::~LogCapture() {
  const std::lock_guard lock(capture_mutex);
  capturing = false;
}

std::string LogCapture::text() const {
  const std::lock_guard lock(capture_mutex);
  return captured;
}

}  // namespace adit::cyclonedds
