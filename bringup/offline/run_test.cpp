// The deterministic runner on deployments as they are shipped.
#include "bringup/offline/run.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

namespace adit::offline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

const fs::path root = ADIT_SOURCE_DIR;

std::string read(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

class Offline : public ::testing::Test {
 protected:
  Offline() : folder_(fs::temp_directory_path() / ("adit_offline_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~Offline() override { fs::remove_all(folder_); }

  RunRequest request(const std::string& name, double duration_s) const {
    RunRequest r;
    r.deployment = (root / "bringup/deployments/default.yaml").string();
    r.input = (root / "bringup/scenarios/s01_zab_round_trip.yaml").string();
    r.out = (folder_ / name).string();
    r.source.duration_s = duration_s;
    return r;
  }
  fs::path folder_;
};

TEST_F(Offline, TwoRunsWriteTheSameBytes) {
  RunRequest first = request("first", 3.0), second = request("second", 3.0);
  second.source.threads = 2;
  for (const RunRequest& r : {first, second}) {
    const Result<RunOutcome> done = run(r);
    ASSERT_TRUE(done) << done.error().message;
    EXPECT_NEAR(done->simulated_s, 3.0, 0.2);
  }
  for (const char* file :
       {"truth.tum", "lidar_default.tum", "fused_default.tum", "fused_default.cov", "fused_default.csv"}) {
    const std::string text = read(folder_ / "first" / file);
    EXPECT_GT(text.size(), 500u) << file;
    EXPECT_TRUE(text == read(folder_ / "second" / file)) << file;
  }
  RunRequest other = request("other", 1.0);
  other.source.seed = 7;
  ASSERT_TRUE(run(other));
  const std::string one = read(folder_ / "other/lidar_default.tum"), all = read(folder_ / "first/lidar_default.tum");
  EXPECT_FALSE(all.starts_with(one));  // another seed, other noise
}

TEST_F(Offline, WhatItLeavesCanBeEvaluated) {
  const RunRequest r = request("run", 3.5);
  ASSERT_TRUE(run(r));
  evaluation::ReportOptions report;
  const Result<evaluation::RunFolder> evaluated = evaluate_run(r.out, r.input, report);
  ASSERT_TRUE(evaluated) << evaluated.error().message;
  EXPECT_FALSE(report.map.empty());
  EXPECT_FALSE(report.inputs.empty());
  const auto& estimates = evaluated->evaluations;
  ASSERT_GE(estimates.size(), 2u);
  EXPECT_EQ(estimates.front().name, "lidar_default");
  EXPECT_EQ(estimates.back().name, "fused_default");
  EXPECT_LT(*estimates.front().ate_rmse_m, 0.1);
  EXPECT_LT(*estimates.back().ate_rmse_m, 0.1);
  EXPECT_TRUE(estimates.back().nees_mean.has_value());
  EXPECT_GT(estimates.back().availability, 0.95);
}

TEST_F(Offline, NamesWhatIsWrong) {
  RunRequest missing = request("missing", 1.0);
  missing.input = (folder_ / "no_such.yaml").string();
  Result<RunOutcome> done = run(missing);
  ASSERT_FALSE(done);
  EXPECT_THAT(done.error().message, HasSubstr("no_such.yaml"));
  RunRequest unknown = request("unknown", 1.0);
  unknown.input = (folder_ / "run.txt").string();
  std::ofstream(unknown.input) << "text";
  done = run(unknown);
  ASSERT_FALSE(done);
  EXPECT_THAT(done.error().message, HasSubstr("run.txt"));
  RunRequest scenario = request("scenario", 1.0);
  scenario.input = (folder_ / "bad.yaml").string();
  std::ofstream(scenario.input) << "name: bad\nwordl: nowhere.yaml\n";
  done = run(scenario);
  ASSERT_FALSE(done);
  EXPECT_THAT(done.error().message, HasSubstr("bad.yaml:"));
}

}  // namespace
}  // namespace adit::offline
