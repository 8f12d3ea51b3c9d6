#include "bringup/evaluation/svg_plot.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace adit::evaluation {
namespace {

constexpr double kLeft = 70.0, kRight = 16.0, kTop = 34.0, kBottom = 46.0;
constexpr std::size_t kMaxPoints = 2000;
// Okabe and Ito's colours: told apart also with impaired colour vision.
constexpr const char* kColours[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#6a3d9a"};

struct Bounds {
  double low = 0.0, high = 0.0;
  bool any = false;
  void add(double value) {
    low = any ? std::min(low, value) : value;
    high = any ? std::max(high, value) : value;
    any = true;
  }
  void pad() {
    if (!any) high = 1.0;
    const double margin = std::max(0.04 * (high - low), 1e-6 * std::max({1.0, std::abs(low), std::abs(high)}));
    low -= margin;
    high += margin;
  }
};

// Data to pixels: independent scales, or one scale for both axes with the data in the middle.
struct Frame {
  Bounds x, y;
  double x_per_px = 1.0, y_per_px = 1.0, width = 0.0, height = 0.0;

  Frame(const Plot& plot) : width(plot.width_px - kLeft - kRight), height(plot.height_px - kTop - kBottom) {
    for (const PlotLine& line : plot.lines) {
      for (const Eigen::Vector2d& p : line.points) {
        if (!p.allFinite()) continue;
        x.add(p.x());
        y.add(p.y());
      }
    }
    for (const std::vector<Eigen::Vector2d>& points : plot.background) {
      if (!plot.whole_background) break;
      for (const Eigen::Vector2d& p : points) {
        if (!p.allFinite()) continue;
        x.add(p.x());
        y.add(p.y());
      }
    }
    x.pad();
    y.pad();
    x_per_px = (x.high - x.low) / width;
    y_per_px = (y.high - y.low) / height;
    if (!plot.equal_axes) return;
    x_per_px = y_per_px = std::max(x_per_px, y_per_px);
    widen(x, x_per_px * width);
    widen(y, y_per_px * height);
  }
  static void widen(Bounds& b, double extent) {
    const double margin = 0.5 * (extent - (b.high - b.low));
    b.low -= margin;
    b.high += margin;
  }
  double px(double value) const { return kLeft + (value - x.low) / x_per_px; }
  double py(double value) const { return kTop + height - (value - y.low) / y_per_px; }
};

std::string format(const char* pattern, double a, double b = 0.0, double c = 0.0, double d = 0.0) {
  char buffer[256];
  std::snprintf(buffer, sizeof buffer, pattern, a, b, c, d);
  return buffer;
}

std::string text_at(double x, double y, const char* attributes, const std::string& text) {
  return format("<text x=\"%.1f\" y=\"%.1f\" ", x, y) + attributes + ">" + escape_html(text) + "</text>\n";
}

std::string axes(const Plot& plot, const Frame& frame) {
  const double right = kLeft + frame.width;
  const double bottom = kTop + frame.height;
  std::string out;
  for (const double tick : round_ticks(frame.x.low, frame.x.high, 9)) {
    const double x = frame.px(tick);
    out += format("<line x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\" stroke=\"#ddd\"/>\n", x, x, kTop, bottom);
    out += text_at(x, bottom + 16, "text-anchor=\"middle\"", format("%.6g", tick));
  }
  for (const double tick : round_ticks(frame.y.low, frame.y.high, 6)) {
    const double y = frame.py(tick);
    out += format("<line x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\" stroke=\"#ddd\"/>\n", kLeft, right, y, y);
    out += text_at(kLeft - 6, y + 4, "text-anchor=\"end\"", format("%.6g", tick));
  }
  out += format("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"none\" stroke=\"#666\"/>\n", kLeft,
                kTop, frame.width, frame.height);
  out += text_at(kLeft + 0.5 * frame.width, bottom + 36, "text-anchor=\"middle\"", plot.x_label);
  const double middle = kTop + 0.5 * frame.height;
  out += text_at(14, middle, (format("text-anchor=\"middle\" transform=\"rotate(-90 14 %.1f)\"", middle)).c_str(),
                 plot.y_label);
  return out;
}

std::string path(const PlotLine& line, const Frame& frame, const std::string& stroke) {
  std::string data;
  bool pen_down = false;
  const std::size_t n = line.points.size();
  const std::size_t step = n / kMaxPoints + 1;
  for (std::size_t i = 0; i < n; ++i) {
    if (i % step != 0 && i + 1 != n) continue;
    const Eigen::Vector2d& p = line.points[i];
    if (!p.allFinite()) {
      pen_down = false;
      continue;
    }
    data += format(pen_down ? "L%.1f %.1f" : "M%.1f %.1f", frame.px(p.x()), frame.py(p.y()));
    pen_down = true;
  }
  return data.empty() ? std::string() : "<path d=\"" + data + "\" fill=\"none\" " + stroke + "/>\n";
}

// Points outside the plot interrupt the line.
std::vector<Eigen::Vector2d> inside(std::vector<Eigen::Vector2d> points, const Frame& frame) {
  for (Eigen::Vector2d& p : points) {
    const bool shown = p.x() >= frame.x.low && p.x() <= frame.x.high && p.y() >= frame.y.low && p.y() <= frame.y.high;
    if (!shown) p.setConstant(std::nan(""));
  }
  return points;
}

}  // namespace

std::string escape_html(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::vector<double> round_ticks(double low, double high, int count) {
  const double rough = (high - low) / std::max(count, 1);
  if (!(rough > 0.0) || !std::isfinite(rough)) return {};
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10.0 * power;
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= rough * (1.0 - 1e-9)) {
      step = factor * power;
      break;
    }
  }
  std::vector<double> ticks;
  const double first = std::ceil(low / step - 1e-9);
  for (int i = 0; (first + i) * step <= high + 1e-9 * step; ++i) ticks.push_back((first + i) * step + 0.0);
  return ticks;
}

std::string render_svg(const Plot& plot) {
  const Frame frame(plot);
  std::string out = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + std::to_string(plot.width_px) + " " +
                    std::to_string(plot.height_px) + "\" width=\"" + std::to_string(plot.width_px) + "\" height=\"" +
                    std::to_string(plot.height_px) + "\" font-family=\"sans-serif\" font-size=\"12\">\n";
  for (const PlotSpan& span : plot.shaded) {
    const double from = std::clamp(frame.px(span.from), kLeft, kLeft + frame.width);
    const double to = std::clamp(frame.px(span.to), kLeft, kLeft + frame.width);
    out += format("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"#f3e3c3\"/>\n", from, kTop,
                  to - from, frame.height);
  }
  out += axes(plot, frame);
  for (const std::vector<Eigen::Vector2d>& points : plot.background) {
    out += path({"", inside(points, frame)}, frame, "stroke=\"#999\" stroke-width=\"0.8\"");
  }
  out += text_at(kLeft, 15, "font-weight=\"bold\"", plot.title);
  double legend_x = kLeft;
  for (std::size_t i = 0; i < plot.lines.size(); ++i) {
    const bool truth = plot.first_is_truth && i == 0;
    const std::size_t colour = (i - (plot.first_is_truth ? 1 : 0)) % std::size(kColours);
    const std::string stroke = truth ? std::string("stroke=\"#333\" stroke-width=\"3\" stroke-opacity=\"0.55\"")
                                     : std::string("stroke=\"") + kColours[colour] + "\" stroke-width=\"1.5\"";
    out += path(plot.lines[i], frame, stroke);
    out += format("<line x1=\"%.1f\" x2=\"%.1f\" y1=\"26\" y2=\"26\" ", legend_x, legend_x + 18) + stroke + "/>\n";
    out += text_at(legend_x + 21, 30, "font-size=\"11\"", plot.lines[i].label);
    legend_x += 29.0 + 6.0 * static_cast<double>(plot.lines[i].label.size());
  }
  return out + "</svg>\n";
}

}  // namespace adit::evaluation
