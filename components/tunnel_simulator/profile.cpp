#include "components/tunnel_simulator/profile.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace adit::tunnel_simulator {
namespace {

constexpr double kPi = std::numbers::pi;

Eigen::Vector2d left_normal(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d d = (b - a).normalized();
  return {-d.y(), d.x()};
}

struct Builder {
  std::vector<Eigen::Vector2d> points;
  std::vector<ProfileEdge> edges;

  void add(double l, double h, ProfileEdge edge_from_here) {
    points.emplace_back(l, h);
    edges.push_back(edge_from_here);
  }
  // From angle a0 to a1 about (cl, ch), without the end point.
  void arc(double cl, double ch, double radius, double a0, double a1, ProfileEdge edge, double edge_length = 0.12) {
    const int n = std::max(2, static_cast<int>(std::ceil(std::abs(a1 - a0) * radius / edge_length)));
    for (int i = 0; i < n; ++i) {
      const double a = a0 + (a1 - a0) * i / n;
      add(cl + radius * std::cos(a), ch + radius * std::sin(a), edge);
    }
  }
  Profile build() { return {std::move(points), std::move(edges)}; }
};

}  // namespace

Profile::Profile(std::vector<Eigen::Vector2d> points, std::vector<ProfileEdge> edges)
    : points_(std::move(points)), edges_(std::move(edges)) {
  min_ = max_ = points_.front();
  for (std::size_t i = 0; i < points_.size(); ++i) {
    min_ = min_.cwiseMin(points_[i]);
    max_ = max_.cwiseMax(points_[i]);
    perimeter_ += (points_[(i + 1) % points_.size()] - points_[i]).norm();
  }
}

double Profile::distance(double l, double h) const {
  const Eigen::Vector2d p(l, h);
  double best = std::numeric_limits<double>::infinity();
  bool inside = false;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Eigen::Vector2d& a = points_[i];
    const Eigen::Vector2d& b = points_[(i + 1) % points_.size()];
    const Eigen::Vector2d d = b - a;
    const double t = std::clamp((p - a).dot(d) / d.squaredNorm(), 0.0, 1.0);
    best = std::min(best, (p - a - t * d).squaredNorm());
    if ((a.y() > h) != (b.y() > h) && l < a.x() + (h - a.y()) / d.y() * d.x()) inside = !inside;
  }
  return inside ? -std::sqrt(best) : std::sqrt(best);
}

std::vector<ProfileVertex> Profile::sampled(double step) const {
  std::vector<ProfileVertex> out;
  const std::size_t n = points_.size();
  double u = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector2d& a = points_[i];
    const Eigen::Vector2d& b = points_[(i + 1) % n];
    const Eigen::Vector2d normal = left_normal(a, b);
    const Eigen::Vector2d before = left_normal(points_[(i + n - 1) % n], a);
    const double length = (b - a).norm();
    const int count = std::max(1, static_cast<int>(std::ceil(length / step - 1e-9)));
    for (int k = 0; k < count; ++k) {
      const Eigen::Vector2d mean = k == 0 ? (normal + before).normalized() : normal;
      out.push_back({a + (b - a) * k / count, mean, u + length * k / count, edges_[i]});
    }
    u += length;
  }
  ProfileVertex last = out.front();
  last.u = u;
  out.push_back(last);
  return out;
}

double Profile::u_at_height(double h, double sign) const {
  double u = 0.0;
  double best_u = 0.0;
  double best = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Eigen::Vector2d& a = points_[i];
    const Eigen::Vector2d& b = points_[(i + 1) % points_.size()];
    const double length = (b - a).norm();
    if ((a.y() > h) != (b.y() > h)) {
      const double t = (h - a.y()) / (b.y() - a.y());
      const double l = sign * (a.x() + t * (b.x() - a.x()));
      if (l > best) {
        best = l;
        best_u = u + t * length;
      }
    }
    u += length;
  }
  return best_u;
}

double Profile::u_nearest(const Eigen::Vector2d& place) const {
  double u = 0.0;
  double best_u = 0.0;
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Eigen::Vector2d& a = points_[i];
    const Eigen::Vector2d d = points_[(i + 1) % points_.size()] - a;
    const double t = std::clamp((place - a).dot(d) / d.squaredNorm(), 0.0, 1.0);
    const double distance = (place - a - t * d).squaredNorm();
    if (distance < best) {
      best = distance;
      best_u = u + t * d.norm();
    }
    u += d.norm();
  }
  return best_u;
}

Eigen::Vector2d Profile::at(double u) const {
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Eigen::Vector2d d = points_[(i + 1) % points_.size()] - points_[i];
    const double length = d.norm();
    if (u <= length) return points_[i] + d * (u / length);
    u -= length;
  }
  return points_.front();
}

Profile road_profile(const RoadProfile& shape, Material lining) {
  const double centre = shape.crown - shape.radius;
  const double side = shape.radius - shape.wall_radius;  // centre of the right wall's arc, mirrored for the left
  const double kerb = shape.kerb_height;
  const double drop = std::asin((kerb - centre) / shape.wall_radius);  // angle of the wall's foot
  const double foot = side + shape.wall_radius * std::cos(drop);
  const double half = shape.carriageway / 2.0;
  const ProfileEdge wall{lining, 1.0F, false};
  const ProfileEdge road{Material::asphalt, 0.15F, false};
  const ProfileEdge walk{Material::kerb, 0.15F, false};
  Builder b;
  // l to the left: counter-clockwise means from the right (negative l) along the floor to the left.
  b.add(-half, 0.0, road);
  b.add(half, 0.0, walk);
  b.add(half, kerb, walk);
  b.add(foot, kerb, wall);
  const double a0 = std::atan2(kerb - centre, foot - side);
  b.arc(side, centre, shape.wall_radius, a0 + 1e-3, 0.0, wall);
  b.arc(0.0, centre, shape.radius, 0.0, kPi, wall);
  b.arc(-side, centre, shape.wall_radius, kPi, kPi - a0, wall);
  b.add(-foot, kerb, walk);
  b.add(-half, kerb, walk);
  return b.build();
}

Profile arch_profile(double width, double height, Material lining, Material floor) {
  const double half = width / 2.0;
  const double rise = std::min(half, height * 0.6);  // of the vault: a circle's segment
  const double radius = (half * half + rise * rise) / (2.0 * rise);
  const double centre = height - radius;
  const double a0 = std::atan2(height - rise - centre, half);
  const ProfileEdge wall{lining, 1.0F, false};
  Builder b;
  b.add(-half, 0.0, {floor, 0.3F, false});
  b.add(half, 0.0, wall);
  b.arc(0.0, centre, radius, a0, kPi - a0, wall);
  b.add(-half, height - rise, wall);
  return b.build();
}

Profile round_profile(double diameter, double floor_width, Material lining, Material floor, double edge_length) {
  const double radius = diameter / 2.0;
  const double half = floor_width / 2.0;
  const double centre = std::sqrt(radius * radius - half * half);
  const double a0 = -std::acos(half / radius);
  Builder b;
  b.add(-half, 0.0, {floor, 0.3F, false});
  b.arc(0.0, centre, radius, a0, kPi - a0, {lining, 1.0F, false}, edge_length);
  return b.build();
}

Profile box_profile(double width, double height, Material walls, Material floor) {
  const double half = width / 2.0;
  const ProfileEdge wall{walls, 0.5F, false};
  Builder b;
  b.add(-half, 0.0, {floor, 0.3F, false});
  b.add(half, 0.0, wall);
  b.add(half, height, wall);
  b.add(-half, height, wall);
  return b.build();
}

Profile open_profile(double width, double road, double height) {
  const ProfileEdge soil{Material::soil, 1.0F, false};
  Builder b;
  b.add(-width / 2.0, 0.0, soil);
  b.add(-road / 2.0, 0.0, {Material::asphalt, 0.1F, false});
  b.add(road / 2.0, 0.0, soil);
  b.add(width / 2.0, 0.0, soil);
  b.add(width / 2.0 + height * 0.7, height, {Material::soil, 0.0F, true});
  b.add(-width / 2.0 - height * 0.7, height, soil);
  return b.build();
}

}  // namespace adit::tunnel_simulator
