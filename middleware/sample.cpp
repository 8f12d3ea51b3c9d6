#include "middleware/sample.hpp"

#include <cstdio>

namespace adit {

std::string to_string(const Gid& gid) {
  std::string text;
  for (std::size_t i = 0; i < gid.bytes.size(); ++i) {
    if (i > 0 && i % 4 == 0) text += '.';
    char hex[3];
    std::snprintf(hex, sizeof hex, "%02x", gid.bytes[i]);
    text += hex;
  }
  return text;
}

}  // namespace adit
