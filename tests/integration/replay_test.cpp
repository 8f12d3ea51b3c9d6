// The main jobs, a process each over DDS: player -> lidar_odometry -> trajectory, and the same with thermal_odometry.
// Live poses are those of the offline command, to the last bit.
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

class Replay : public testing::TestWithParam<Vendors> {
 protected:
  // Of the shared data; empty when they are not there.
  static fs::path recording(const char* name) {
    const char* const place = std::getenv("ADIT_SHARED");
    const fs::path data = (place ? fs::path(place) : source / "../shared") / "data" / name;
    return fs::exists(data) ? data : fs::path();
  }
  // `adit run` of a replay deployment on the vendors of the test, its files in out/ and run.json.
  Output live(const char* deployment, const std::vector<std::string>& settings) const {
    std::vector<std::string> words{"run",
                                   (source / "bringup/deployments" / deployment).string(),
                                   "--quiet",
                                   "--domain",
                                   private_domain(),
                                   "--summary",
                                   folder_.file("run.json")};
    for (const std::string& setting : settings) words.insert(words.end(), {"--set", setting});
    for (const std::string& setting : {"OUT=" + folder_.file("out"), std::string("MIDDLEWARE_A=") + GetParam().a,
                                       std::string("MIDDLEWARE_B=") + GetParam().b}) {
      words.insert(words.end(), {"--set", setting});
    }
    return run_adit(words, 150.0);
  }
  // `adit odometry` with these parameters, into offline.tum.
  Output offline(std::vector<std::string> words, const std::string& parameters) const {
    const std::string config = folder_.write("config.yaml", "/**:\n  ros__parameters: " + parameters + "\n");
    words.insert(words.begin(), "odometry");
    words.insert(words.end(),
                 {"--config", config, "--out", folder_.file("offline.tum"), "--timing", folder_.file("timing.csv")});
    return run_adit(words, 150.0);
  }
  Result<Trajectory> poses(const char* file) const { return read_tum(folder_.file(file)); }
  static void expect_equal(const Result<Trajectory>& one, const Result<Trajectory>& other) {
    ASSERT_TRUE(one) << one.error().message;
    ASSERT_TRUE(other) << other.error().message;
    ASSERT_EQ(one->size(), other->size());
    for (std::size_t i = 0; i < one->size(); ++i) EXPECT_EQ(tum_line((*one)[i]), tum_line((*other)[i]));
  }
  nlohmann::json json(const char* name) const {
    std::ifstream file(folder_.file(name));
    return nlohmann::json::parse(file);
  }
  static void expect_no_loss(const nlohmann::json& summary, const std::vector<std::string>& topics) {
    for (const std::string& topic : topics) {
      ASSERT_TRUE(summary["links"].contains(topic)) << topic;
      EXPECT_EQ(summary["links"][topic]["lost"], 0) << topic;
      EXPECT_EQ(summary["links"][topic]["dropped"], 0) << topic;
    }
  }
  TemporaryFolder folder_;
};

TEST_P(Replay, LidarBeatsTheStoredOdometryAndLosesNothing) {
  const fs::path data = recording("subt_anymal_vlp16");
  if (data.empty()) GTEST_SKIP() << "skipped: no shared data";
  const std::string stored = (data / "maplab_lidar.tum").string();
  const Output run = live("lidar_replay.yaml", {"DATASET=" + data.string(), "ODOMETRY=" + stored, "USE_PRIOR=true"});
  ASSERT_EQ(run.exit_code, 0) << run.text;

  const Result<Trajectory> estimate = poses("out/lidar.tum");
  const Result<Trajectory> truth = read_tum((data / "ref_lidar.tum").string());
  ASSERT_TRUE(estimate) << estimate.error().message;
  ASSERT_TRUE(truth);
  ASSERT_EQ(estimate->size(), 24u);
  const Pose error = (truth->front().pose.inverse() * truth->back().pose).inverse() *
                     (estimate->front().pose.inverse() * estimate->back().pose);
  EXPECT_LT(error.translation().norm(), 0.3);                     // stored odometry: 1.1 m
  EXPECT_LT(so3_log(error.linear()).norm() * 180.0 / M_PI, 1.5);  // stored odometry: 5.9 degrees

  const Output same =
      offline({"lidar", "--input", data.string(), "--prior", stored}, "{mode: default, max_range: 80.0}");
  ASSERT_EQ(same.exit_code, 0) << same.text;
  expect_equal(estimate, poses("offline.tum"));

  const Output evaluate = run_adit({"evaluate", "--truth", (data / "ref_lidar.tum").string(), "--estimate",
                                    "lidar=" + folder_.file("out/lidar.tum"), "--run", folder_.file("run.json"),
                                    "--out", folder_.file("report")});
  ASSERT_EQ(evaluate.exit_code, 0) << evaluate.text;
  const nlohmann::json summary = json("report/summary.json");
  EXPECT_EQ(summary["estimates"]["lidar"]["frames"], 24);
  expect_no_loss(summary, {"/lidar/points", "/prior/odometry", "/lidar/odometry"});
  for (const char* topic : {"/lidar/points", "/prior/odometry", "/lidar/odometry"}) {
    // The first cloud may go out more than once: until the odometry, found by discovery, has answered.
    EXPECT_GE(summary["links"][topic]["sent"], 24) << topic;
    EXPECT_LE(summary["links"][topic]["sent"], 34) << topic;
  }
  EXPECT_GT(summary["realtime_factor"], 1.0);
  EXPECT_TRUE(fs::exists(folder_.file("report/report.html")));
}

TEST_P(Replay, ThermalPosesAreThoseOfTheOfflineRun) {
  const fs::path data = recording("synthetic_thermal");
  if (data.empty()) GTEST_SKIP() << "skipped: no shared data";
  const Output run = live("thermal_replay.yaml",
                          {"DATASET=" + data.string(), "CAMERA=[417.032, 417.032, 319.5, 255.5]", "SIZE=[640, 512]"});
  ASSERT_EQ(run.exit_code, 0) << run.text;
  const Output same = offline({"thermal", "--input", data.string()}, "{mode: mono}");
  ASSERT_EQ(same.exit_code, 0) << same.text;
  const Result<Trajectory> estimate = poses("out/thermal.tum");
  ASSERT_TRUE(estimate) << estimate.error().message;
  expect_equal(estimate, poses("offline.tum"));
  EXPECT_GT(estimate->size(), 90u);  // of 110 frames: the start takes about ten
  expect_no_loss(json("run.json"), {"/thermal/frame", "/thermal/odometry"});
}

INSTANTIATE_TEST_SUITE_P(Vendors, Replay,
                         testing::Values(Vendors{"fastdds", "fastdds", "fastdds"},
                                         Vendors{"cyclonedds", "cyclonedds", "cyclonedds"},
                                         Vendors{"mixed", "fastdds", "cyclonedds"}),
                         [](const auto& vendors) { return std::string(vendors.param.name); });

}  // namespace
}  // namespace adit::integration
