// Errors along and across a curved tunnel.
#pragma once

#include <vector>

#include "components/geometry/se3.hpp"

namespace adit::evaluation {

// A polyline seen from above. Points nearer than 1 mm to their predecessor are left out.
class CentreLine {
 public:
  explicit CentreLine(const std::vector<Eigen::Vector2d>& points);

  struct Split {
    double axial_m = 0.0;    // ahead of the truth in its direction of travel positive
    double lateral_m = 0.0;  // left of the truth in its direction of travel positive
  };
  // Stations and distances of the estimate minus those of the truth. The estimate is looked for on the line within
  // twice its distance from the truth (the line may come back beside itself); beyond the ends the line goes on
  // straight. Fewer than two points: the split along the truth's heading.
  Split split(const Pose& truth, const Eigen::Vector3d& estimate) const;

 private:
  struct Place {
    double station = 0.0, left = 0.0, distance = 0.0;
    Eigen::Vector2d direction = Eigen::Vector2d::UnitX();
  };
  // Nearest place of `point` between two stations; with `heading`, pieces more than 45 degrees across it are not
  // considered.
  Place nearest(const Eigen::Vector2d& point, double from, double to, const Eigen::Vector2d* heading) const;

  std::vector<Eigen::Vector2d> points_;
  std::vector<double> stations_;
};

}  // namespace adit::evaluation
