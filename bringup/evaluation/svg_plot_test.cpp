#include "bringup/evaluation/svg_plot.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <regex>

namespace adit::evaluation {
namespace {

TEST(SvgPlot, RoundTicks) {
  EXPECT_EQ(round_ticks(0.0, 10.0, 5), (std::vector<double>{0, 2, 4, 6, 8, 10}));
  EXPECT_EQ(round_ticks(-1.0, 1.0, 4), (std::vector<double>{-1, -0.5, 0, 0.5, 1}));
  EXPECT_TRUE(round_ticks(1.0, 1.0, 5).empty());
  EXPECT_TRUE(round_ticks(0.0, std::numeric_limits<double>::infinity(), 5).empty());
}

TEST(SvgPlot, EqualAxesKeepSquaresSquare) {
  Plot plot;
  plot.equal_axes = true;
  plot.lines.push_back({"square", {{0, 0}, {10, 0}, {10, 10}}});
  const std::string svg = render_svg(plot);
  std::smatch m;
  ASSERT_TRUE(
      std::regex_search(svg, m, std::regex("d=\"M([0-9.]+) ([0-9.]+)L([0-9.]+) ([0-9.]+)L([0-9.]+) ([0-9.]+)")));
  const double width = std::stod(m[3]) - std::stod(m[1]);
  const double height = std::stod(m[4]) - std::stod(m[6]);
  EXPECT_NEAR(width, height, 0.2);
  EXPECT_GT(width, 100.0);
}

TEST(SvgPlot, NonFinitePointsInterruptTheLine) {
  Plot plot;
  plot.lines.push_back({"gap", {{0, 0}, {1, 1}, {std::nan(""), 0}, {2, 1}, {3, 0}}});
  const std::string svg = render_svg(plot);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  std::smatch m;
  ASSERT_TRUE(std::regex_search(svg, m, std::regex("d=\"([^\"]*)\"")));
  const std::string d = m[1];
  EXPECT_EQ(std::count(d.begin(), d.end(), 'M'), 2);
  EXPECT_EQ(std::count(d.begin(), d.end(), 'L'), 2);
}

TEST(SvgPlot, ThinsLongLinesAndKeepsTheLastPoint) {
  Plot plot;
  PlotLine& line = plot.lines.emplace_back();
  for (int i = 0; i <= 100'000; ++i) line.points.emplace_back(i, i);
  const std::string svg = render_svg(plot);
  EXPECT_LT(svg.size(), 60'000u);
  std::smatch m;
  ASSERT_TRUE(std::regex_search(svg, m, std::regex("d=\"M([0-9.]+) [^\"]*L([0-9.]+) [0-9.]+\"")));
  EXPECT_GT(std::stod(m[2]), std::stod(m[1]) + 700.0);
}

TEST(SvgPlot, EmptyAndConstantPlotsAreDrawn) {
  Plot plot;
  plot.title = "a < b & \"c\"";
  EXPECT_NE(render_svg(plot).find("a &lt; b &amp; &quot;c&quot;"), std::string::npos);
  plot.lines.push_back({"constant", {{5, 3}, {5, 3}}});
  const std::string svg = render_svg(plot);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.find("inf"), std::string::npos);
}

}  // namespace
}  // namespace adit::evaluation
