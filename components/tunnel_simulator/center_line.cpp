#include "components/tunnel_simulator/center_line.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace adit::tunnel_simulator {
namespace {

constexpr double kPiece = 2.0;

// Gauss-Legendre nodes and weights on [0, 1], five points.
constexpr std::array<double, 5> kNodes{0.046910077030668, 0.230765344947158, 0.5, 0.769234655052842, 0.953089922969332};
constexpr std::array<double, 5> kWeights{0.118463442528095, 0.239314335249683, 0.284444444444444, 0.239314335249683,
                                         0.118463442528095};

Eigen::Vector2d integrate(double heading, double curvature, double rate, double length) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < kNodes.size(); ++i) {
    const double d = kNodes[i] * length;
    const double angle = heading + d * (curvature + 0.5 * rate * d);
    sum += kWeights[i] * Eigen::Vector2d(std::cos(angle), std::sin(angle));
  }
  return sum * length;
}

}  // namespace

CenterLine::CenterLine(const LineStart& start, const std::vector<LineElement>& elements)
    : start_(start), elements_(elements) {
  double grade = elements.empty() ? 0.0 : elements.front().grade;
  pieces_.push_back({0.0, start.x, start.y, start.z, start.heading, 0.0, 0.0, grade, 0.0});
  for (const LineElement& e : elements) {
    const double rate = (e.curvature_end - e.curvature_begin) / e.length;
    const double blend = e.grade == grade ? 0.0 : std::min(e.grade_blend, e.length);
    if (blend > 0.0) append(blend, e.curvature_begin, e.curvature_begin + rate * blend, grade, e.grade);
    if (blend < e.length) append(e.length - blend, e.curvature_begin + rate * blend, e.curvature_end, e.grade, e.grade);
    grade = e.grade;
  }
}

// The last entry of pieces_ is always the open end from which the next piece starts.
void CenterLine::append(double length, double k0, double k1, double g0, double g1) {
  const int count = std::max(1, static_cast<int>(std::ceil(length / kPiece)));
  const double step = length / count;
  for (int i = 0; i < count; ++i) {
    Piece& p = pieces_.back();
    p.curvature = k0 + (k1 - k0) * i / count;
    p.curvature_rate = (k1 - k0) / length;
    p.grade = g0 + (g1 - g0) * i / count;
    p.grade_rate = (g1 - g0) / length;
    const Eigen::Vector2d moved = integrate(p.heading, p.curvature, p.curvature_rate, step);
    const Piece end{p.s + step,
                    p.x + moved.x(),
                    p.y + moved.y(),
                    p.z + step * (p.grade + 0.5 * p.grade_rate * step),
                    p.heading + step * (p.curvature + 0.5 * p.curvature_rate * step),
                    0.0,
                    0.0,
                    p.grade + p.grade_rate * step,
                    0.0};
    pieces_.push_back(end);
  }
  length_ += length;
}

const CenterLine::Piece& CenterLine::piece_at(double s) const {
  const auto next =
      std::upper_bound(pieces_.begin(), pieces_.end(), s, [](double v, const Piece& p) { return v < p.s; });
  return next == pieces_.begin() ? pieces_.front() : *std::prev(next);
}

LinePoint CenterLine::at(double s) const {
  const Piece& p = piece_at(s);
  double d = s - p.s;
  LinePoint out;
  if (d < 0.0) {  // straight before the start
    out.position = {p.x + d * std::cos(p.heading), p.y + d * std::sin(p.heading), p.z + d * p.grade};
    out.heading = p.heading;
    out.grade = p.grade;
    return out;
  }
  const Eigen::Vector2d moved = integrate(p.heading, p.curvature, p.curvature_rate, d);
  out.position = {p.x + moved.x(), p.y + moved.y(), p.z + d * (p.grade + 0.5 * p.grade_rate * d)};
  out.heading = p.heading + d * (p.curvature + 0.5 * p.curvature_rate * d);
  out.curvature = p.curvature + p.curvature_rate * d;
  out.grade = p.grade + p.grade_rate * d;
  return out;
}

Eigen::Vector3d CenterLine::point(double s, double l, double h) const {
  const LinePoint p = at(s);
  return p.position + Eigen::Vector3d(-l * std::sin(p.heading), l * std::cos(p.heading), h);
}

LineCoordinates CenterLine::project(const Eigen::Vector3d& point) const {
  double s = 0.0;
  double best = std::numeric_limits<double>::infinity();
  for (const Piece& p : pieces_) {
    const double d = (p.x - point.x()) * (p.x - point.x()) + (p.y - point.y()) * (p.y - point.y());
    if (d < best) {
      best = d;
      s = p.s;
    }
  }
  LineCoordinates out;
  for (int i = 0; i < 8; ++i) {
    const LinePoint p = at(s);
    const Eigen::Vector2d offset = (point - p.position).head<2>();
    const Eigen::Vector2d tangent(std::cos(p.heading), std::sin(p.heading));
    out.l = -tangent.y() * offset.x() + tangent.x() * offset.y();
    out.h = point.z() - p.position.z();
    out.s = s;
    const double along = tangent.dot(offset);
    if (std::abs(along) < 1e-10) break;
    const double scale = std::max(0.2, 1.0 - p.curvature * out.l);
    s += along / scale;
  }
  return out;
}

CenterLine CenterLine::parallel(double offset) const {
  LineStart start = start_;
  start.x -= offset * std::sin(start.heading);
  start.y += offset * std::cos(start.heading);
  const auto bent = [&](double curvature) { return curvature / (1.0 - curvature * offset); };
  std::vector<LineElement> elements;
  for (const LineElement& e : elements_) {
    const int parts = e.curvature_begin == e.curvature_end ? 1 : 16;
    double grade_blend = e.grade_blend;
    for (int i = 0; i < parts; ++i) {
      const double k0 = e.curvature_begin + (e.curvature_end - e.curvature_begin) * i / parts;
      const double k1 = e.curvature_begin + (e.curvature_end - e.curvature_begin) * (i + 1) / parts;
      const double length = e.length / parts - offset * 0.5 * (k0 + k1) * e.length / parts;
      elements.push_back({length, bent(k0), bent(k1), e.grade, grade_blend});
      grade_blend = 0.0;
    }
  }
  return CenterLine(start, elements);
}

}  // namespace adit::tunnel_simulator
