#include "components/tunnel_simulator/atmosphere.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace adit::tunnel_simulator {

Extinction extinction(Obscurant kind, double visibility) {
  Extinction e;
  if (visibility <= 0.0) return e;
  e.visible = 3.912 / visibility;
  // Backscatter 0.046 / MOR with MOR = ln 20 / extinction: Hahner et al., "Fog simulation on real LiDAR point clouds"
  // (ICCV 2021), eq. 7. Soot absorbs most of what a droplet would scatter (single-scattering albedo about 0.2).
  const double fog_backscatter = 0.046 * e.visible / std::log(20.0);
  if (kind == Obscurant::soot) {
    e.lidar = 0.64 * e.visible;
    e.thermal = 0.04 * e.visible;
    e.backscatter = 0.2 * fog_backscatter;
  } else {
    e.lidar = e.visible;
    e.thermal = 0.4 * e.visible;
    e.backscatter = fog_backscatter;
  }
  return e;
}

void Atmosphere::add(const SmokeBox& box) {
  boxes_.push_back(box);
}

void Atmosphere::add_along(const CenterLine& line, double from, double to, double ramp, Obscurant kind,
                           double visibility, double width, double height) {
  const Extinction full = extinction(kind, visibility);
  const int count = std::max(1, static_cast<int>(std::ceil((to - from) / 5.0)));
  const double step = (to - from) / count;
  for (int i = 0; i < count; ++i) {
    const double s = from + (i + 0.5) * step;
    const double density = ramp > 0.0 ? std::clamp(std::min(s - from, to - s) / ramp, 0.0, 1.0) : 1.0;
    const LinePoint p = line.at(s);
    SmokeBox box;
    box.pose.linear() = Eigen::AngleAxisd(p.heading, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    box.pose.translation() = p.position + Eigen::Vector3d(0.0, 0.0, 0.5 * height);
    box.half_size = {0.5 * step, 0.5 * width, 0.5 * height + 0.5};
    box.extinction = {density * full.visible, density * full.lidar, density * full.thermal, density * full.backscatter};
    boxes_.push_back(box);
  }
}

Atmosphere Atmosphere::near(const Eigen::Vector3d& place, double reach) const {
  Atmosphere out;
  for (const SmokeBox& b : boxes_) {
    if ((b.pose.translation() - place).norm() < reach + b.half_size.norm()) out.boxes_.push_back(b);
  }
  return out;
}

OpticalDepth Atmosphere::depth(const Eigen::Vector3d& from, const Eigen::Vector3d& direction, double range) const {
  OpticalDepth sum;
  for (const SmokeBox& b : boxes_) {
    const Eigen::Vector3d o = b.pose.linear().transpose() * (from - b.pose.translation());
    const Eigen::Vector3d d = b.pose.linear().transpose() * direction;
    double enter = 0.0;
    double leave = range;
    for (int i = 0; i < 3; ++i) {
      const double inverse = 1.0 / d[i];
      const double a = (-b.half_size[i] - o[i]) * inverse;
      const double c = (b.half_size[i] - o[i]) * inverse;
      enter = std::max(enter, std::min(a, c));
      leave = std::min(leave, std::max(a, c));
    }
    if (leave <= enter) continue;
    sum.lidar += b.extinction.lidar * (leave - enter);
    sum.thermal += b.extinction.thermal * (leave - enter);
  }
  return sum;
}

Extinction Atmosphere::at(const Eigen::Vector3d& point) const {
  Extinction sum;
  for (const SmokeBox& b : boxes_) {
    const Eigen::Vector3d p = b.pose.linear().transpose() * (point - b.pose.translation());
    if ((p.cwiseAbs() - b.half_size).maxCoeff() > 0.0) continue;
    sum.visible += b.extinction.visible;
    sum.lidar += b.extinction.lidar;
    sum.thermal += b.extinction.thermal;
    sum.backscatter += b.extinction.backscatter;
  }
  return sum;
}

}  // namespace adit::tunnel_simulator
