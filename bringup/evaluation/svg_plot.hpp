// A line plot as inline SVG: axes with round ticks, grid, legend, shaded intervals.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace adit::evaluation {

struct PlotLine {
  std::string label;
  std::vector<Eigen::Vector2d> points;  // non-finite points interrupt the line
};

struct PlotSpan {
  double from = 0.0, to = 0.0;  // on the x axis
};

struct Plot {
  std::string title, x_label, y_label;
  std::vector<PlotLine> lines;                           // the first one is drawn dark and wide: the truth
  std::vector<PlotSpan> shaded;                          // outages
  std::vector<std::vector<Eigen::Vector2d>> background;  // thin grey lines without label (walls)
  bool whole_background = false;                         // all of it is shown; else only what lies within the lines
  bool first_is_truth = false;
  bool equal_axes = false;  // one metre is as long on both axes (top views)
  int width_px = 900, height_px = 380;
};

// The <svg> element. Lines of more than ~2000 points are thinned (each kept point is an input point).
std::string render_svg(const Plot& plot);

// & < > " replaced, for text and attributes.
std::string escape_html(const std::string& text);

// About `count` round numbers (1, 2 or 5 times a power of ten apart) inside [low, high].
std::vector<double> round_ticks(double low, double high, int count);

}  // namespace adit::evaluation
