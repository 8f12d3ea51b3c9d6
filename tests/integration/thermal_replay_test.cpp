// The main job of the thermal side: player -> thermal_odometry -> trajectory, a process each, over DDS; the same poses
// as offline.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <nlohmann/json.hpp>

#include "components/geometry/trajectory.hpp"
#include "tests/integration/adit_process.hpp"

namespace adit::integration {
namespace {

namespace fs = std::filesystem;

const fs::path source = ADIT_SOURCE_DIR;

struct Vendors {
  const char* name;
  const char* a;  // player and recorder
  const char* b;  // odometry
};

class ThermalReplay : public testing::TestWithParam<Vendors> {};

TEST_P(ThermalReplay, LivePosesAreThoseOfTheOfflineRun) {
  const char* const place = std::getenv("ADIT_SHARED");
  const fs::path data = (place ? fs::path(place) : source / "../shared") / "data/synthetic_thermal";
  if (!fs::exists(data)) GTEST_SKIP() << "skipped: no shared data";
  const TemporaryFolder folder;
  const Output run = run_adit(
      {"run", (source / "bringup/deployments/thermal_replay.yaml").string(), "--quiet", "--domain", private_domain(),
       "--set", "DATASET=" + data.string(), "--set", "CAMERA=[417.032, 417.032, 319.5, 255.5]", "--set",
       "SIZE=[640, 512]", "--set", "OUT=" + folder.file("out"), "--set", std::string("MIDDLEWARE_A=") + GetParam().a,
       "--set", std::string("MIDDLEWARE_B=") + GetParam().b, "--summary", folder.file("run.json")},
      150.0);
  ASSERT_EQ(run.exit_code, 0) << run.text;

  const std::string config = folder.write("config.yaml", "/**:\n  ros__parameters: {mode: mono}\n");
  const Output offline = run_adit({"odometry", "thermal", "--input", data.string(), "--config", config, "--out",
                                   folder.file("offline.tum"), "--timing", folder.file("timing.csv")},
                                  150.0);
  ASSERT_EQ(offline.exit_code, 0) << offline.text;
  const Result<Trajectory> live = read_tum(folder.file("out/thermal.tum"));
  const Result<Trajectory> same = read_tum(folder.file("offline.tum"));
  ASSERT_TRUE(live) << live.error().message;
  ASSERT_TRUE(same) << same.error().message;
  EXPECT_GT(same->size(), 90u);  // of 110 frames: the start takes about ten
  ASSERT_EQ(live->size(), same->size());
  for (std::size_t i = 0; i < same->size(); ++i) EXPECT_EQ(tum_line((*same)[i]), tum_line((*live)[i]));

  std::ifstream file(folder.file("run.json"));
  const nlohmann::json summary = nlohmann::json::parse(file);
  for (const char* topic : {"/thermal/frame", "/thermal/odometry"}) {
    ASSERT_TRUE(summary["links"].contains(topic)) << topic;
    EXPECT_EQ(summary["links"][topic]["lost"], 0) << topic;
    EXPECT_EQ(summary["links"][topic]["dropped"], 0) << topic;
  }
}

INSTANTIATE_TEST_SUITE_P(Vendors, ThermalReplay,
                         testing::Values(Vendors{"fastdds", "fastdds", "fastdds"},
                                         Vendors{"cyclonedds", "cyclonedds", "cyclonedds"},
                                         Vendors{"mixed", "fastdds", "cyclonedds"}),
                         [](const auto& vendors) { return std::string(vendors.param.name); });

}  // namespace
}  // namespace adit::integration
