#include "bringup/evaluation/report.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

namespace adit::evaluation {
namespace {

Trajectory circle(double heading_gain) {
  Trajectory path;
  for (int i = 0; i <= 400; ++i) {
    StampedPose p;
    p.stamp_ns = 100'000'000LL * i;
    const double angle = 0.05 * i;  // more than three turns
    p.pose.linear() = so3_exp({0, 0, heading_gain * angle});
    p.pose.translation() = Eigen::Vector3d(10 * std::sin(angle), 10 - 10 * std::cos(angle), 0);
    path.push_back(p);
  }
  return path;
}

std::vector<Evaluation> evaluations() {
  Evaluation e = *evaluate(circle(1.0), circle(1.01));
  e.name = "fused <b>";
  return {e, nothing_delivered("thermal", circle(1.0))};
}

TEST(Report, IsSelfContainedAndComplete) {
  ReportOptions options;
  options.title = "Round trip & more";
  options.outages_ns = {{5'000'000'000, 9'000'000'000}};
  const std::string html = report_html(circle(1.0), evaluations(), options);
  for (const char* part : {"Round trip &amp; more", "fused &lt;b&gt;", "Top view", "Position error over distance",
                           "Heading error over time", "Drift by length", "Axial error", "#f3e3c3"}) {
    EXPECT_NE(html.find(part), std::string::npos) << part;
  }
  for (const char* never : {"<script", "src=", "href=", "url(", "nan", "fused <b>"}) {
    EXPECT_EQ(html.find(never), std::string::npos) << never;
  }
}

TEST(Report, HeadingCountsTurns) {
  const Plot plot = heading_over_time(circle(1.0), evaluations());
  ASSERT_EQ(plot.lines.size(), 3u);
  const double end = 0.05 * 400 * 180.0 / std::numbers::pi;
  EXPECT_NEAR(plot.lines[0].points.back().y(), end, 1e-6);
  EXPECT_NEAR(plot.lines[1].points.back().y(), 1.01 * end, 1e-6);
}

TEST(Report, WritesOrSaysWhyNot) {
  const std::string path = (std::filesystem::temp_directory_path() / "adit_report_test.html").string();
  ASSERT_TRUE(write_report(path, circle(1.0), evaluations()));
  EXPECT_GT(std::filesystem::file_size(path), 10'000u);
  std::filesystem::remove(path);
  EXPECT_FALSE(write_report("/nonexistent/report.html", circle(1.0), evaluations()));
  EXPECT_FALSE(write_report(path, circle(1.0), {}));
}

}  // namespace
}  // namespace adit::evaluation
