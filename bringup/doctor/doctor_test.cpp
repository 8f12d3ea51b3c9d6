#include "bringup/doctor/doctor.hpp"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

namespace adit::doctor {
namespace {

using testing::HasSubstr;

class DoctorTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ = std::filesystem::temp_directory_path() / ("adit_doctor_" + std::to_string(::getpid()));
    std::filesystem::create_directories(root_ / "proc/sys/net/core");
    std::filesystem::create_directories(root_ / "proc/42");
    std::filesystem::create_directories(root_ / "shm");
    machine_ = {(root_ / "proc").string(), (root_ / "shm").string()};
  }
  void TearDown() override { std::filesystem::remove_all(root_); }
  void write(const std::string& path, const std::string& text) { std::ofstream(root_ / path) << text; }

  std::filesystem::path root_;
  Machine machine_;
};

TEST_F(DoctorTest, SmallSocketBuffersAreNamedWithTheCommandThatMendsThem) {
  write("proc/sys/net/core/rmem_max", "212992\n");
  write("proc/sys/net/core/wmem_max", "4194304\n");
  const Finding finding = check_socket_buffers(machine_, 4u << 20);
  EXPECT_EQ(finding.level, Finding::Level::warning);
  EXPECT_THAT(finding.finding, HasSubstr("net.core.rmem_max=212992"));
  EXPECT_THAT(finding.finding, testing::Not(HasSubstr("wmem_max")));
  EXPECT_THAT(finding.fix, HasSubstr("sysctl -w net.core.rmem_max=4194304"));
  write("proc/sys/net/core/rmem_max", "4194304\n");
  EXPECT_EQ(check_socket_buffers(machine_, 4u << 20).level, Finding::Level::ok);
}

TEST_F(DoctorTest, OnlyUnmappedSegmentsAreStale) {
  write("shm/fastrtps_0011223344556677", "");
  write("shm/fastrtps_8899aabbccddeeff", "");
  write("shm/fastrtps_8899aabbccddeeff_el", "");
  write("shm/fastrtps_port7411", "");
  write("proc/42/maps", "7f00-7f01 rw-s 00000000 00:17 5 " + machine_.shm + "/fastrtps_0011223344556677\n");
  const Finding finding = check_stale_segments(machine_);
  EXPECT_EQ(finding.level, Finding::Level::warning);
  EXPECT_THAT(finding.finding, HasSubstr("fastrtps_8899aabbccddeeff"));
  EXPECT_THAT(finding.finding, testing::Not(HasSubstr("fastrtps_0011223344556677")));
}

TEST_F(DoctorTest, MissingSharedMemoryFails) {
  machine_.shm = (root_ / "absent").string();
  EXPECT_EQ(check_shared_memory(machine_, 1).level, Finding::Level::failure);
}

TEST(Doctor, UnknownInterfaceListsThoseThatExist) {
  EXPECT_EQ(check_interface("loopback").level, Finding::Level::ok);
  const Finding finding = check_interface("nope0");
  EXPECT_EQ(finding.level, Finding::Level::failure);
  EXPECT_THAT(finding.fix, HasSubstr("lo (127.0.0.1)"));
}

TEST(Doctor, TextShowsTheFixUnderTheFinding) {
  EXPECT_EQ(to_text({{Finding::Level::failure, "a", "b", "c"}}), "FAIL  a: b\n      fix: c\n");
}

}  // namespace
}  // namespace adit::doctor
