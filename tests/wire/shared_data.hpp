// Where the captured data lies: ../shared beside the source tree, or what ADIT_SHARED says.
#pragma once

#include <cstdlib>
#include <filesystem>

namespace adit::test {

inline std::filesystem::path shared_folder() {
  if (const char* folder = std::getenv("ADIT_SHARED")) return folder;
  return std::filesystem::path(ADIT_SOURCE_DIR) / ".." / "shared";
}

}  // namespace adit::test
