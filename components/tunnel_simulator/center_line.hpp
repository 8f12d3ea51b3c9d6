// The axis of a tunnel: a curve of piecewise linear curvature (straights, arcs, clothoids) in plan, with a piecewise
// linear grade. World frame: x east, y north, z up, metres.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace adit::tunnel_simulator {

// One element of the alignment. Curvature [1/m] is positive to the left and runs linearly from begin to end; the grade
// (rise per plan metre) is reached linearly within `grade_blend` metres from that of the element before.
struct LineElement {
  double length = 0.0;
  double curvature_begin = 0.0;
  double curvature_end = 0.0;
  double grade = 0.0;
  double grade_blend = 30.0;
};

struct LineStart {
  double x = 0.0, y = 0.0, z = 0.0;
  double heading = 0.0;  // rad, from +x to +y
};

struct LinePoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double heading = 0.0;
  double curvature = 0.0;  // in plan
  double grade = 0.0;
};

// Coordinates of a point along and across a line: station s (plan arc length), lateral l (left positive), height h
// above the line at s.
struct LineCoordinates {
  double s = 0.0, l = 0.0, h = 0.0;
};

class CenterLine {
 public:
  CenterLine() : pieces_(1) {}  // along x from the origin, of no length
  CenterLine(const LineStart& start, const std::vector<LineElement>& elements);

  double length() const { return length_; }
  // Position to round-off (Gauss-Legendre from the nearest node). Outside [0, length] the line continues straight.
  LinePoint at(double s) const;
  // The world point at station s, lateral l, height h.
  Eigen::Vector3d point(double s, double l, double h) const;
  // Nearest station in plan. Exact for points nearer than the radius of curvature.
  LineCoordinates project(const Eigen::Vector3d& point) const;
  // The line at lateral distance `offset` (left positive): arcs exactly, clothoids in 16 parts, to a
  // centimetre.
  CenterLine parallel(double offset) const;

 private:
  struct Piece {  // at most 2 m long, curvature and grade linear
    double s = 0, x = 0, y = 0, z = 0, heading = 0, curvature = 0, curvature_rate = 0, grade = 0, grade_rate = 0;
  };
  void append(double length, double k0, double k1, double g0, double g1);
  const Piece& piece_at(double s) const;

  LineStart start_;
  std::vector<LineElement> elements_;
  std::vector<Piece> pieces_;
  double length_ = 0.0;
};

}  // namespace adit::tunnel_simulator
