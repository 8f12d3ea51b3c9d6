#include "bringup/evaluation/study.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace adit::evaluation {
namespace {

StudyRow row(const std::string& scenario, std::uint64_t seed, const std::string& estimate, double drift) {
  StudyRow r;
  r.scenario = scenario;
  r.seed = seed;
  r.estimate = estimate;
  r.distance_m = 100.0;
  r.drift_percent = drift;
  r.axial_percent = -drift;
  r.outages = {{.from_ns = 1, .to_ns = 2, .error_m = 10.0 * drift, .distance_m = 50.0}};
  r.availability = 0.9 + 0.01 * static_cast<double>(seed);
  r.largest_gap_s = 0.1 * static_cast<double>(seed);
  return r;
}

TEST(Study, MediansAndTheWorstOfEachEstimate) {
  const std::vector<StudyRow> rows = {row("s01", 1, "fused", 0.2), row("s01", 1, "lidar", 5.0),
                                      row("s01", 2, "fused", 0.4), row("s01", 2, "lidar", 7.0),
                                      row("s01", 3, "fused", 0.3)};
  const std::string table = print_study(rows);
  EXPECT_NE(table.find("0.300 (0.400)"), std::string::npos) << table;
  EXPECT_NE(table.find("6.000 (7.000)"), std::string::npos) << table;  // also of the axial errors, by their size
  EXPECT_NE(table.find("91.0"), std::string::npos) << table;           // the least available
  EXPECT_NE(table.find("0.30"), std::string::npos) << table;           // the longest gap
  EXPECT_NE(table.find("3.00 (4.00)"), std::string::npos) << table;    // of the outage
  const nlohmann::json json = nlohmann::json::parse(study_json(rows));
  ASSERT_EQ(json["runs"].size(), 5u);
  EXPECT_EQ(json["runs"][3]["estimate"], "lidar");
  EXPECT_EQ(json["runs"][3]["drift_percent"], 7.0);
  EXPECT_TRUE(json["runs"][3]["nees"].is_null());
  EXPECT_EQ(json["runs"][3]["outages"][0]["error_m"], 70.0);
}

TEST(Study, Median) {
  EXPECT_FALSE(median({}).has_value());
  EXPECT_DOUBLE_EQ(*median({3.0, 1.0, 2.0}), 2.0);
  EXPECT_DOUBLE_EQ(*median({4.0, 1.0}), 2.5);
}

}  // namespace
}  // namespace adit::evaluation
