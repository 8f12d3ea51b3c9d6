// The main job: player -> lidar_odometry -> trajectory, a process each, over DDS.
#include <gmock/gmock.h>

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

class Replay : public testing::TestWithParam<Vendors> {};

TEST_P(Replay, RealSequenceBeatsTheStoredOdometryAndLosesNothing) {
  const char* const place = std::getenv("ADIT_SHARED");
  const fs::path data = (place ? fs::path(place) : source / "../shared") / "data/subt_anymal_vlp16";
  if (!fs::exists(data)) GTEST_SKIP() << "skipped: no shared data";
  const TemporaryFolder folder;
  const Output run = run_adit(
      {"run", (source / "bringup/deployments/lidar_replay.yaml").string(), "--quiet", "--domain", private_domain(),
       "--set", "DATASET=" + data.string(), "--set", "ODOMETRY=" + (data / "maplab_lidar.tum").string(), "--set",
       "USE_PRIOR=true", "--set", "OUT=" + folder.file("out"), "--set", std::string("MIDDLEWARE_A=") + GetParam().a,
       "--set", std::string("MIDDLEWARE_B=") + GetParam().b, "--summary", folder.file("run.json")},
      120.0);
  ASSERT_EQ(run.exit_code, 0) << run.text;

  const Result<Trajectory> estimate = read_tum(folder.file("out/lidar.tum"));
  const Result<Trajectory> truth = read_tum((data / "ref_lidar.tum").string());
  ASSERT_TRUE(estimate) << estimate.error().message;
  ASSERT_TRUE(truth);
  ASSERT_EQ(estimate->size(), 24u);
  const Pose error = (truth->front().pose.inverse() * truth->back().pose).inverse() *
                     (estimate->front().pose.inverse() * estimate->back().pose);
  EXPECT_LT(error.translation().norm(), 0.3);                     // stored odometry: 1.1 m
  EXPECT_LT(so3_log(error.linear()).norm() * 180.0 / M_PI, 1.5);  // stored odometry: 5.9 degrees

  // Offline, without DDS, on one thread: the same poses to the last bit.
  const std::string config = folder.write("config.yaml", "/**:\n  ros__parameters: {mode: default, max_range: 80.0}\n");
  const Output offline =
      run_adit({"odometry", "lidar", "--input", data.string(), "--prior", (data / "maplab_lidar.tum").string(),
                "--config", config, "--out", folder.file("offline.tum"), "--timing", folder.file("timing.csv")});
  ASSERT_EQ(offline.exit_code, 0) << offline.text;
  const Result<Trajectory> same = read_tum(folder.file("offline.tum"));
  ASSERT_TRUE(same);
  ASSERT_EQ(same->size(), estimate->size());
  for (std::size_t i = 0; i < same->size(); ++i) EXPECT_EQ(tum_line((*same)[i]), tum_line((*estimate)[i]));

  const Output evaluate = run_adit({"evaluate", "--truth", (data / "ref_lidar.tum").string(), "--estimate",
                                    "lidar=" + folder.file("out/lidar.tum"), "--run", folder.file("run.json"), "--out",
                                    folder.file("report")});
  ASSERT_EQ(evaluate.exit_code, 0) << evaluate.text;
  std::ifstream file(folder.file("report/summary.json"));
  const nlohmann::json summary = nlohmann::json::parse(file);
  EXPECT_EQ(summary["estimates"]["lidar"]["frames"], 24);
  for (const char* topic : {"/lidar/points", "/prior/odometry", "/lidar/odometry"}) {
    // The first cloud may go out more than once: until the odometry, found by discovery, has answered.
    EXPECT_GE(summary["links"][topic]["sent"], 24) << topic;
    EXPECT_LE(summary["links"][topic]["sent"], 34) << topic;
    EXPECT_EQ(summary["links"][topic]["lost"], 0) << topic;
    EXPECT_EQ(summary["links"][topic]["dropped"], 0) << topic;
  }
  EXPECT_GT(summary["realtime_factor"], 1.0);
  EXPECT_TRUE(fs::exists(folder.file("report/report.html")));
}

INSTANTIATE_TEST_SUITE_P(Vendors, Replay,
                         testing::Values(Vendors{"fastdds", "fastdds", "fastdds"},
                                         Vendors{"cyclonedds", "cyclonedds", "cyclonedds"},
                                         Vendors{"mixed", "fastdds", "cyclonedds"}),
                         [](const auto& vendors) { return std::string(vendors.param.name); });

}  // namespace
}  // namespace adit::integration
