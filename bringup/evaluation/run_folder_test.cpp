#include "bringup/evaluation/run_folder.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "bringup/evaluation/consistency.hpp"

namespace adit::evaluation {
namespace {

namespace fs = std::filesystem;

class Folder : public ::testing::Test {
 protected:
  Folder() : path_(fs::temp_directory_path() / ("adit_run_folder_" + std::to_string(::getpid()))) {
    fs::create_directories(path_);
  }
  ~Folder() override { fs::remove_all(path_); }
  std::string file(const std::string& name) const { return (path_ / name).string(); }
  void write(const std::string& name, const std::string& text) const { std::ofstream(file(name)) << text; }

  // Along y (heading 90 degrees) at 1 m/s; the estimate begins at its own origin, heading along x, and is 1 % long.
  void write_run() const {
    std::string truth, estimate, covariance;
    for (int i = 0; i <= 100; ++i) {
      const std::string stamp = std::to_string(1000 + i) + ".000000000 ";
      truth += stamp + "5 " + std::to_string(i) + " 0 0 0 0.7071067811865476 0.7071067811865476\n";
      estimate += stamp + std::to_string(1.01 * i) + " 0 0 0 0 0 1\n";
      covariance += stamp + "0.25 0 0 0.01 0 0.0001\n";
    }
    write("truth.tum", truth);
    write("fused_default.tum", estimate);
    write("lidar_kiss.tum", estimate);
    write("fused_default.cov", covariance);
  }
  fs::path path_;
};

TEST_F(Folder, HoldsARun) {
  write_run();
  write("fused_default.csv",
        "# header\n1000.0,4,1,0.1,lidar,0,0,0,0,0,0,0\n1001.0,1,1,0.1,lidar,6,3,1.5,10,1,2,3\n"
        "1003.0,1,0.98,0.01,lidar,3,3,1.25,20,1,2,3\n");
  const Result<RunFolder> run = evaluate_folder(path_.string(), {});
  ASSERT_TRUE(run) << run.error().message;
  ASSERT_EQ(run->evaluations.size(), 2u);
  EXPECT_EQ(run->evaluations[0].name, "lidar_kiss");
  EXPECT_FALSE(run->evaluations[0].nees_mean.has_value());
  const Evaluation& fused = run->evaluations[1];
  EXPECT_EQ(fused.name, "fused_default");
  EXPECT_NEAR(*fused.axial_end_m, 1.0, 1e-9);
  EXPECT_NEAR(*fused.drift_percent, 1.0, 1e-9);
  // Error 0.01 i along the way, variance 0.25 along it: NEES = 4e-4 i^2, mean 4e-4 * 3350 over i = 0..100.
  ASSERT_TRUE(fused.nees_mean.has_value());
  EXPECT_NEAR(*fused.nees_mean, 4e-4 * 3350.0, 1e-6);
  EXPECT_DOUBLE_EQ(*fused.sigma3_coverage, 1.0);  // at most 1 m, sigma 0.5 m
  ASSERT_EQ(run->fusion.size(), 1u);
  EXPECT_DOUBLE_EQ(run->fusion[0].mode_s[4], 1.0);
  EXPECT_DOUBLE_EQ(run->fusion[0].mode_s[1], 2.0);
  ASSERT_EQ(run->fusion[0].sensors.size(), 1u);
  EXPECT_EQ(run->fusion[0].sensors[0].accepted, 20u);
  ASSERT_EQ(run->fusion[0].sensors[0].innovations.size(), 2u);
  EXPECT_DOUBLE_EQ(run->fusion[0].sensors[0].innovations[0].value, 2.0);
}

TEST_F(Folder, CoverageCountsWhatLiesOutside) {
  write_run();
  const Result<RunFolder> run = evaluate_folder(path_.string(), {});
  ASSERT_TRUE(run);
  Evaluation evaluation = run->evaluations[1];
  Result<std::vector<StampedCovariance>> covariances = read_covariances(file("fused_default.cov"));
  ASSERT_TRUE(covariances);
  for (StampedCovariance& c : *covariances) c.covariance(0, 0) = 0.01;  // 3 sigma: 0.3 m, reached at i = 30
  add_consistency(*covariances, evaluation);
  EXPECT_NEAR(*evaluation.sigma3_coverage, 31.0 / 101.0, 0.011);
  add_consistency({}, evaluation);
  EXPECT_FALSE(evaluation.nees_mean.has_value());
}

TEST_F(Folder, SaysWhatIsWrong) {
  EXPECT_FALSE(evaluate_folder(path_.string(), {}));
  write("truth.tum", "1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n");
  const Result<RunFolder> alone = evaluate_folder(path_.string(), {});
  ASSERT_FALSE(alone);
  EXPECT_NE(alone.error().message.find("no trajectories"), std::string::npos);
  write("a.tum", "");
  const Result<RunFolder> nothing = evaluate_folder(path_.string(), {});
  ASSERT_TRUE(nothing) << nothing.error().message;
  EXPECT_EQ(nothing->evaluations[0].availability, 0.0);
  write("a.cov", "1.000000000 1 2 3\n");
  EXPECT_FALSE(read_covariances(file("a.cov")));
  write("a.csv", "1,2,3\n");
  EXPECT_FALSE(read_fusion_log(file("a.csv")));
}

}  // namespace
}  // namespace adit::evaluation
