#include "bringup/evaluation/summary.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>

#include <nlohmann/json.hpp>

namespace adit::evaluation {
namespace {

Trajectory line(int n, double step) {
  Trajectory path(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    path[static_cast<std::size_t>(i)].stamp_ns = 100'000'000LL * i;
    path[static_cast<std::size_t>(i)].pose.translation().x() = step * i;
  }
  return path;
}

std::vector<Evaluation> two() {
  const Trajectory truth = line(201, 0.1);
  Evaluation good = *evaluate(truth, line(201, 0.099));
  good.name = "lidar";
  return {good, nothing_delivered("thermal", truth)};
}

TEST(Summary, HasExactlyTheAgreedKeys) {
  const nlohmann::json j = nlohmann::json::parse(summary_json(two()));
  const auto keys = [](const nlohmann::json& object) {
    std::set<std::string> out;
    for (const auto& item : object.items()) out.insert(item.key());
    return out;
  };
  EXPECT_EQ(keys(j), (std::set<std::string>{"estimates", "distance_m", "duration_s"}));
  for (const char* name : {"lidar", "thermal"}) {
    EXPECT_EQ(keys(j["estimates"][name]),
              (std::set<std::string>{"ate_m", "rpe_10m_percent", "drift_percent", "yaw_end_deg", "scale",
                                     "availability", "frames", "axial_end_m", "lateral_end_m", "largest_gap_s", "nees",
                                     "sigma3_coverage", "cpu_s", "error_end_m"}));
  }
  EXPECT_NEAR(j["distance_m"].get<double>(), 20.0, 1e-9);
  EXPECT_NEAR(j["duration_s"].get<double>(), 20.0, 1e-9);
  EXPECT_NEAR(j["estimates"]["lidar"]["drift_percent"].get<double>(), 1.0, 1e-9);
  EXPECT_EQ(j["estimates"]["lidar"]["frames"].get<int>(), 201);
  EXPECT_TRUE(j["estimates"]["thermal"]["ate_m"].is_null());
  EXPECT_EQ(j["estimates"]["thermal"]["availability"].get<double>(), 0.0);
}

TEST(Summary, WritesTheFileAndRefusesWhatItCannot) {
  const std::string path = (std::filesystem::temp_directory_path() / "adit_summary_test.json").string();
  const std::vector<Evaluation> evaluations = two();
  ASSERT_TRUE(write_summary(path, evaluations));
  std::ifstream file(path);
  EXPECT_EQ(nlohmann::json::parse(file), nlohmann::json::parse(summary_json(evaluations)));
  std::filesystem::remove(path);
  EXPECT_FALSE(write_summary(path, {}));
  const std::vector<Evaluation> twins = {evaluations[0], evaluations[0]};
  EXPECT_FALSE(write_summary(path, twins));
  EXPECT_FALSE(write_summary("/nonexistent/summary.json", evaluations));
}

TEST(Summary, NamesOfAnyBytesDoNotThrow) {
  std::vector<Evaluation> evaluations = two();
  evaluations[0].name = "\xff\"<";
  EXPECT_FALSE(nlohmann::json::parse(summary_json(evaluations), nullptr, false).is_discarded());
}

TEST(Summary, TableHasARowAnEstimateAndDashes) {
  const std::string table = print_table(two());
  EXPECT_NE(table.find("lidar"), std::string::npos);
  EXPECT_NE(table.find("1.000"), std::string::npos);
  EXPECT_NE(table.find("  -"), std::string::npos);
  EXPECT_EQ(table.find("nan"), std::string::npos);
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 4);
  EXPECT_NE(print_drift_table(two()).find("rotation"), std::string::npos);
  EXPECT_TRUE(print_drift_table({}).empty());
}

}  // namespace
}  // namespace adit::evaluation
