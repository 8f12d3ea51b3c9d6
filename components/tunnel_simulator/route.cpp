#include "components/tunnel_simulator/route.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace adit::tunnel_simulator {
namespace {

constexpr std::array<double, 5> kNodes{0.046910077030668, 0.230765344947158, 0.5, 0.769234655052842, 0.953089922969332};
constexpr std::array<double, 5> kWeights{0.118463442528095, 0.239314335249683, 0.284444444444444, 0.239314335249683,
                                         0.118463442528095};

}  // namespace

Route::Local Route::evaluate(const Curve& curve, double parameter) {
  Local out;
  if (!curve.is_leg) {
    Eigen::Matrix<double, 6, 3> powers = Eigen::Matrix<double, 6, 3>::Zero();
    double power = 1.0;
    for (int i = 0; i < 6; ++i, power *= parameter) {
      powers(i, 0) = power;
      if (i + 1 < 6) powers(i + 1, 1) = (i + 1) * power;
      if (i + 2 < 6) powers(i + 2, 2) = (i + 2) * (i + 1) * power;
    }
    const Eigen::Matrix3d d = curve.coefficients * powers;
    return {d.col(0), d.col(1), d.col(2)};
  }
  const RouteLeg& leg = curve.leg;
  const double sign = leg.to >= leg.from ? 1.0 : -1.0;
  const double l = sign * leg.offset;
  const LinePoint p = leg.line.at(leg.from + sign * parameter);
  const Eigen::Vector3d along(std::cos(p.heading), std::sin(p.heading), 0.0);
  const Eigen::Vector3d left(-along.y(), along.x(), 0.0);
  out.position = p.position + l * left;
  const double scale = 1.0 - p.curvature * l;
  out.first = sign * (scale * along + p.grade * Eigen::Vector3d::UnitZ());
  out.second = scale * p.curvature * left;  // without the change of curvature: it acts along the path only
  return out;
}

double Route::arc(const Curve& curve, double from, double to) {
  double sum = 0.0;
  for (std::size_t i = 0; i < kNodes.size(); ++i) {
    sum += kWeights[i] * evaluate(curve, from + kNodes[i] * (to - from)).first.norm();
  }
  return sum * (to - from);
}

Route::Curve Route::join(const Curve& from, const Curve& to) {
  const Local a = evaluate(from, from.end);
  const Local b = evaluate(to, 0.0);
  const Eigen::Vector3d ta = a.first.normalized();
  const Eigen::Vector3d tb = b.first.normalized();
  const double chord = (b.position - a.position).norm();
  const double half_turn = 0.5 * std::acos(std::clamp(ta.dot(tb), -1.0, 1.0));
  const double reach = half_turn > 1e-3 ? chord * half_turn / std::sin(half_turn) : chord;
  const auto bend = [&](const Local& c) {  // second derivative at speed `reach` that has the curve's curvature
    const Eigen::Vector3d t = c.first.normalized();
    const Eigen::Vector3d across = c.second - t * t.dot(c.second);
    return Eigen::Vector3d(across / c.first.squaredNorm() * reach * reach);
  };
  const Eigen::Vector3d p0 = a.position, v0 = reach * ta, w0 = bend(a);
  const Eigen::Vector3d p1 = b.position, v1 = reach * tb, w1 = bend(b);
  Curve out;
  out.is_leg = false;
  out.end = 1.0;
  out.coefficients.col(0) = p0;
  out.coefficients.col(1) = v0;
  out.coefficients.col(2) = 0.5 * w0;
  out.coefficients.col(3) = 10.0 * (p1 - p0) - 6.0 * v0 - 4.0 * v1 - 1.5 * w0 + 0.5 * w1;
  out.coefficients.col(4) = -15.0 * (p1 - p0) + 8.0 * v0 + 7.0 * v1 + 1.5 * w0 - w1;
  out.coefficients.col(5) = 6.0 * (p1 - p0) - 3.0 * (v0 + v1) - 0.5 * w0 + 0.5 * w1;
  return out;
}

void Route::add(Curve curve) {
  const std::size_t index = curves_.size();
  const double step_length = curve.is_leg ? 1.0 : 0.01;
  const int steps = std::max(1, static_cast<int>(std::ceil(curve.end / step_length)));
  for (int i = 0; i < steps; ++i) {
    const double from = curve.end * i / steps;
    nodes_.push_back({index, from, length_});
    length_ += arc(curve, from, curve.end * (i + 1) / steps);
  }
  curves_.push_back(std::move(curve));
}

Route::Route(const std::vector<RouteLeg>& legs, bool closed) : closed_(closed) {
  std::vector<Curve> parts;
  for (const RouteLeg& leg : legs) {
    Curve curve;
    curve.leg = leg;
    curve.end = std::abs(leg.to - leg.from);
    parts.push_back(std::move(curve));
  }
  for (std::size_t i = 0; i < parts.size(); ++i) {
    add(parts[i]);
    const bool last = i + 1 == parts.size();
    if (last && !closed) break;
    const Curve& next = parts[(i + 1) % parts.size()];
    const double gap = (evaluate(next, 0.0).position - evaluate(parts[i], parts[i].end).position).norm();
    if (gap > 1e-6) add(join(parts[i], next));
  }
}

RoutePoint Route::at(double distance) const {
  if (closed_) {
    distance -= length_ * std::floor(distance / length_);
  } else {
    distance = std::clamp(distance, 0.0, length_);
  }
  auto node =
      std::upper_bound(nodes_.begin(), nodes_.end(), distance, [](double v, const Node& n) { return v < n.distance; });
  if (node != nodes_.begin()) --node;
  const Curve& curve = curves_[node->curve];
  const double wanted = distance - node->distance;
  double parameter = node->parameter + wanted / evaluate(curve, node->parameter).first.norm();
  for (int i = 0; i < 6; ++i) {
    const double error = arc(curve, node->parameter, parameter) - wanted;
    if (std::abs(error) < 1e-13) break;
    parameter -= error / evaluate(curve, parameter).first.norm();
  }
  const Local c = evaluate(curve, parameter);
  RoutePoint out;
  out.position = c.position;
  out.tangent = c.first.normalized();
  const double plan = c.first.head<2>().norm();
  out.curvature = (c.first.x() * c.second.y() - c.first.y() * c.second.x()) / (plan * plan * plan);
  return out;
}

}  // namespace adit::tunnel_simulator
