// A cloud as planes in voxels: what clouds are registered to.
#pragma once

#include <cstdint>
#include <unordered_map>

#include "components/mapping/cloud.hpp"

namespace adit::mapping {

struct Plane {
  Eigen::Vector3f mean = Eigen::Vector3f::Zero();
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  // unit; its sign says nothing
  float thickness2 = 0.0F;                           // variance along the normal [m^2]
  float normal_variance = 0.0F;                      // of the normal's direction [rad^2]
};

class PlaneMap {
 public:
  // `size`: edge of a voxel [m]. Voxels with fewer than 5 points, or whose points do not lie flat, hold no plane.
  PlaneMap(std::span<const Point> points, double size);

  // The plane that lies best at a point: that of its voxel or of one beside it. Null: none.
  const Plane* nearest(const Eigen::Vector3f& position) const;
  std::size_t size() const { return planes_.size(); }

 private:
  float size_;
  std::vector<Plane> planes_;
  std::unordered_map<std::uint64_t, std::uint32_t> index_;
};

}  // namespace adit::mapping
