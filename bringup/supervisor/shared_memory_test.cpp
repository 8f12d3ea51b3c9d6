#include "bringup/supervisor/shared_memory.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace adit {
namespace {

namespace fs = std::filesystem;

TEST(SharedMemory, OnlyWhatNobodyHasMappedIsRemoved) {
  const fs::path root = fs::temp_directory_path() / ("adit_segments_" + std::to_string(::getpid()));
  const std::string shm = (root / "shm").string();
  const std::string proc = (root / "proc").string();
  fs::create_directories(root / "shm");
  fs::create_directories(root / "proc/7");
  fs::create_directories(root / "proc/8");
  for (const char* name : {"fastrtps_aa", "fastrtps_aa_el", "fastrtps_bb", "fastrtps_cc", "fastrtps_port7411"}) {
    std::ofstream(root / "shm" / name) << "x";
  }
  const auto maps = [&](const char* pid, const std::string& names) {
    std::ofstream(root / "proc" / pid / "maps") << names;
  };
  const std::string line = "7f00-7f01 rw-s 00000000 00:17 5 " + shm + "/";
  maps("7", line + "fastrtps_aa\n" + line + "fastrtps_bb\n" + line + "fastrtps_port7411\n");
  maps("8", line + "fastrtps_bb\n");

  const std::set<std::string> seen = segments_of(proc, shm, 7);
  EXPECT_EQ(seen, (std::set<std::string>{"fastrtps_aa", "fastrtps_bb"}));
  fs::remove_all(root / "proc/7");  // killed
  EXPECT_EQ(remove_unmapped(seen, proc, shm), 1u);
  EXPECT_FALSE(fs::exists(root / "shm/fastrtps_aa"));
  EXPECT_FALSE(fs::exists(root / "shm/fastrtps_aa_el"));
  EXPECT_TRUE(fs::exists(root / "shm/fastrtps_bb"));  // another process uses it
  EXPECT_TRUE(fs::exists(root / "shm/fastrtps_cc"));  // not known to be ours
  EXPECT_TRUE(fs::exists(root / "shm/fastrtps_port7411"));
  fs::remove_all(root);
}

}  // namespace
}  // namespace adit
