#include "bringup/evaluation/svg_plot.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

namespace adit::evaluation {
namespace {

// The commands of the first path: "M1 2L3 4". Not std::regex: that recurses once a character.
std::string first_path(const std::string& svg) {
  const std::string attribute = " d=\"";
  const std::size_t begin = svg.find(attribute);
  if (begin == std::string::npos) return "";
  const std::size_t text = begin + attribute.size();
  return svg.substr(text, svg.find('"', text) - text);
}

// Its numbers, x and y in turns.
std::vector<double> coordinates_of(std::string path) {
  std::replace_if(
      path.begin(), path.end(), [](char c) { return c == 'M' || c == 'L'; }, ' ');
  std::istringstream in(path);
  return {std::istream_iterator<double>(in), {}};
}

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
  const std::vector<double> at = coordinates_of(first_path(render_svg(plot)));
  ASSERT_EQ(at.size(), 6u);
  const double width = at[2] - at[0];
  const double height = at[3] - at[5];
  EXPECT_NEAR(width, height, 0.2);
  EXPECT_GT(width, 100.0);
}

TEST(SvgPlot, NonFinitePointsInterruptTheLine) {
  Plot plot;
  plot.lines.push_back({"gap", {{0, 0}, {1, 1}, {std::nan(""), 0}, {2, 1}, {3, 0}}});
  const std::string svg = render_svg(plot);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  const std::string d = first_path(svg);
  EXPECT_EQ(std::count(d.begin(), d.end(), 'M'), 2);
  EXPECT_EQ(std::count(d.begin(), d.end(), 'L'), 2);
}

TEST(SvgPlot, ThinsLongLinesAndKeepsTheLastPoint) {
  Plot plot;
  PlotLine& line = plot.lines.emplace_back();
  for (int i = 0; i <= 100'000; ++i) line.points.emplace_back(i, i);
  const std::string svg = render_svg(plot);
  EXPECT_LT(svg.size(), 60'000u);
  const std::vector<double> at = coordinates_of(first_path(svg));
  ASSERT_GE(at.size(), 4u);
  EXPECT_GT(at[at.size() - 2], at.front() + 700.0);
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
