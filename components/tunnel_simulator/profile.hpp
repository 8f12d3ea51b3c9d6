// Cross-sections: closed polygons in the plane (l, h): l to the left of the axis, h up, metres; origin on the axis at
// road level. Counter-clockwise with l as the first axis, so the inward normal lies to the left of each edge.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "components/tunnel_simulator/material.hpp"

namespace adit::tunnel_simulator {

struct ProfileEdge {
  Material material = Material::concrete;
  float roughness = 1.0F;  // factor on the lining's roughness
  bool open = false;       // no surface (sky)
};

struct ProfileVertex {
  Eigen::Vector2d position;  // (l, h)
  Eigen::Vector2d normal;    // inward, mean of the two edges
  double u = 0.0;            // arc length from the first vertex
  ProfileEdge edge;          // of the edge that starts here
};

class Profile {
 public:
  Profile() = default;
  // `edges[i]` belongs to points[i] .. points[i + 1].
  Profile(std::vector<Eigen::Vector2d> points, std::vector<ProfileEdge> edges);

  // Signed distance: negative inside.
  double distance(double l, double h) const;
  double perimeter() const { return perimeter_; }
  // The polygon with edges no longer than `step`, closed: the last vertex repeats the first place at u = perimeter.
  std::vector<ProfileVertex> sampled(double step) const;
  // Where the horizontal line at height h leaves the section on the side of `sign` (+1 left, -1 right): its arc length.
  double u_at_height(double h, double sign) const;
  // Arc length of the place nearest to (l, h), and the place of an arc length.
  double u_nearest(const Eigen::Vector2d& place) const;
  Eigen::Vector2d at(double u) const;
  double width() const { return max_.x() - min_.x(); }
  const Eigen::Vector2d& min() const { return min_; }
  const Eigen::Vector2d& max() const { return max_; }

 private:
  std::vector<Eigen::Vector2d> points_;
  std::vector<ProfileEdge> edges_;
  Eigen::Vector2d min_ = Eigen::Vector2d::Zero(), max_ = Eigen::Vector2d::Zero();
  double perimeter_ = 0.0;
};

struct RoadProfile {
  double radius = 5.3;       // of the crown arc
  double crown = 6.9;        // height of the crown above the road
  double carriageway = 7.5;  // width between the kerbs
  double kerb_height = 0.15;
  double wall_radius = 7.5;  // of the walls below the crown arc's centre
};
Profile road_profile(const RoadProfile& shape, Material lining);
// Vault of radius width / 2 on vertical walls, flat floor.
Profile arch_profile(double width, double height, Material lining, Material floor);
// Circle whose invert is cut flat `floor_width` wide; road level is that floor.
Profile round_profile(double diameter, double floor_width, Material lining, Material floor, double edge_length = 0.12);
// Closed box, floor at h = 0.
Profile box_profile(double width, double height, Material walls, Material floor);
// A cutting under the open sky: floor of `width`, of which the middle `road` is asphalt, slopes up to `height`.
Profile open_profile(double width, double road, double height);

}  // namespace adit::tunnel_simulator
