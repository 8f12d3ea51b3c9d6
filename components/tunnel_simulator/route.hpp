// The path a vehicle follows: parts of tunnel axes, joined by smooth curves, by arc length.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "components/tunnel_simulator/center_line.hpp"
#include "idl/result.hpp"

namespace adit::tunnel_simulator {

// Along a centre line from one station to another (backwards when from > to), `offset` metres to the left of the
// direction of travel.
struct RouteLeg {
  CenterLine line;
  double from = 0.0, to = 0.0;
  double offset = 0.0;
};

struct RoutePoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d tangent = Eigen::Vector3d::UnitX();  // unit
  double curvature = 0.0;                              // in plan, left positive [1/m]
};

class Route {
 public:
  Route() = default;
  // Legs in order; gaps between the end of a leg and the begin of the next (and, when closed, back to the first) are
  // bridged by quintic Hermite curves that meet both with equal position, tangent and curvature.
  Route(const std::vector<RouteLeg>& legs, bool closed);

  double length() const { return length_; }  // of one lap
  bool closed() const { return closed_; }
  // At arc length `distance`; wraps when closed, clamps when not. Smooth: suited to differentiate twice numerically.
  RoutePoint at(double distance) const;

 private:
  struct Curve {  // a leg, or a quintic per axis on [0, 1]
    bool is_leg = true;
    RouteLeg leg;
    Eigen::Matrix<double, 3, 6> coefficients = Eigen::Matrix<double, 3, 6>::Zero();
    double end = 0.0;  // of the parameter, from 0
  };
  struct Node {  // of the table parameter <-> arc length
    std::size_t curve;
    double parameter, distance;
  };
  struct Local {
    Eigen::Vector3d position, first, second;  // derivatives by the parameter
  };
  static Local evaluate(const Curve& curve, double parameter);
  static double arc(const Curve& curve, double from, double to);
  void add(Curve curve);
  static Curve join(const Curve& from, const Curve& to);

  std::vector<Curve> curves_;
  std::vector<Node> nodes_;
  double length_ = 0.0;
  bool closed_ = false;
};

}  // namespace adit::tunnel_simulator
