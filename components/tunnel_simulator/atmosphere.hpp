// Smoke and fog: extinction along rays (Beer-Lambert) through boxes of uniform density.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include "components/tunnel_simulator/center_line.hpp"

namespace adit::tunnel_simulator {

enum class Obscurant : std::uint8_t { soot, fog };

// Extinction coefficients [1/m] of an obscurant with meteorological visibility V [m]: Koschmieder 3.912 / V in the
// visible; soot absorbs in proportion to 1/wavelength, fog droplets are larger than either wavelength
// (localization_spec 3.4).
struct Extinction {
  double visible = 0.0, lidar = 0.0, thermal = 0.0;
  double backscatter = 0.0;  // at the LiDAR's wavelength [1/(m sr)]
};
Extinction extinction(Obscurant kind, double visibility);

// A cloud of one density: the points within half_size of the pose's origin in its axes.
struct SmokeBox {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  Eigen::Vector3d half_size = Eigen::Vector3d::Zero();
  Extinction extinction;
};

struct OpticalDepth {
  double lidar = 0.0, thermal = 0.0;
};

class Atmosphere {
 public:
  void add(const SmokeBox& box);
  // Boxes of at most 5 m along the line between two stations, density falling linearly to nothing within `ramp` metres
  // of both ends.
  void add_along(const CenterLine& line, double from, double to, double ramp, Obscurant kind, double visibility,
                 double width, double height);
  bool empty() const { return boxes_.empty(); }
  // Boxes that come nearer than `reach` to a place: what a sensor there needs to look at.
  Atmosphere near(const Eigen::Vector3d& place, double reach) const;

  // One-way optical depth from a point along a unit direction to a range: transmission is exp(-depth).
  OpticalDepth depth(const Eigen::Vector3d& from, const Eigen::Vector3d& direction, double range) const;
  // Extinction at a point: the sum over the boxes it lies in.
  Extinction at(const Eigen::Vector3d& point) const;

 private:
  std::vector<SmokeBox> boxes_;
};

}  // namespace adit::tunnel_simulator
