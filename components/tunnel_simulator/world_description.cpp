#include "components/tunnel_simulator/world_description.hpp"

#include <cmath>
#include <numbers>

#include "components/tunnel_simulator/random.hpp"

namespace adit::tunnel_simulator {

Equipment equipment_of(VolumeKind kind, int level) {
  Equipment e;
  if (kind == VolumeKind::room || kind == VolumeKind::open) {
    e.lamps = e.signs = 0.0;
    e.trees = kind == VolumeKind::open && level > 0;
    e.geometry = level > 0;
    return e;
  }
  const bool road = kind == VolumeKind::road;
  e.rails = kind == VolumeKind::rail;
  if (kind == VolumeKind::gallery) {
    e.lamps = 20.0;
    e.signs = 50.0;
  }
  e.geometry = level >= 1;
  if (level >= 1 && kind != VolumeKind::gallery) e.niches = 125.0;
  if (level >= 2) {
    e.cabinets = road ? 62.0 : 80.0;
    e.hydrants = road ? 106.0 : 0.0;
    e.fans = road ? 120.0 : 0.0;
    e.rubble = kind == VolumeKind::gallery ? 2.0 : 15.0;
    e.tray = e.pipe = true;
  }
  return e;
}

void add_niches(WorldDescription& world) {
  const std::size_t count = world.volumes.size();
  for (std::size_t i = 0; i < count; ++i) {
    const VolumeDescription tube = world.volumes[i];
    if (tube.equipment.niches <= 0.0) continue;
    int k = 0;
    for (double s = 0.5 * tube.equipment.niches; s < tube.line.length() - 5.0; s += tube.equipment.niches, ++k) {
      const double side = k % 2 == 0 ? 1.0 : -1.0;
      const Eigen::Vector2d wall = tube.profile.at(tube.profile.u_at_height(1.2, side));
      const double inner = std::abs(wall.x()) - 0.5;
      const double floor = tube.kind == VolumeKind::road ? 0.16 : 0.05;
      const Eigen::Vector3d start = tube.line.point(s, side * inner, floor);
      VolumeDescription niche;
      niche.name = tube.name + ".niche" + std::to_string(k);
      niche.line =
          CenterLine({start.x(), start.y(), start.z(), tube.line.at(s).heading + side * std::numbers::pi / 2.0},
                     {{0.5 + 1.2, 0.0, 0.0, 0.0, 0.0}});
      niche.profile = box_profile(2.0, 2.5, Material::concrete, Material::concrete);
      niche.lining = {Material::concrete, 0.0, 0.5, 0.0};
      niche.equipment = equipment_of(VolumeKind::room, 0);
      niche.cap_end = true;
      world.volumes.push_back(niche);
    }
  }
}

void add_lay_bys(WorldDescription& world) {
  constexpr double kLength = 40.0, kDepth = 3.0, kOverlap = 1.5, kHeight = 4.5;
  const std::size_t count = world.volumes.size();
  for (std::size_t i = 0; i < count; ++i) {
    const VolumeDescription tube = world.volumes[i];
    const double spacing = tube.equipment.lay_bys;
    if (spacing <= 0.0) continue;
    int k = 0;
    for (double s = 0.5 * spacing; s + 0.5 * kLength < tube.line.length() - 10.0; s += spacing, ++k) {
      if (s < 0.5 * kLength + 10.0) continue;
      const double wall = std::abs(tube.profile.at(tube.profile.u_at_height(1.2, -1.0)).x());
      const double middle = -(wall + 0.5 * (kDepth - kOverlap));
      const double floor = tube.kind == VolumeKind::road ? 0.02 : 0.05;
      // A straight box along the chord: in a curve it overlaps the tube a little more or less.
      const Eigen::Vector3d begin = tube.line.point(s - 0.5 * kLength, middle, floor);
      const Eigen::Vector3d end = tube.line.point(s + 0.5 * kLength, middle, floor);
      const Eigen::Vector3d along = end - begin;
      const double length = along.head<2>().norm();
      VolumeDescription bay;
      bay.name = tube.name + ".lay_by" + std::to_string(k);
      bay.line = CenterLine({begin.x(), begin.y(), begin.z(), std::atan2(along.y(), along.x())},
                            {{length, 0.0, 0.0, along.z() / length, 0.0}});
      bay.profile = box_profile(kDepth + kOverlap, kHeight, tube.lining.material, Material::asphalt);
      bay.lining = tube.lining;
      bay.equipment = equipment_of(VolumeKind::room, 0);
      bay.cap_begin = bay.cap_end = true;
      world.volumes.push_back(bay);
    }
  }
}

CenterLine random_line(const LineStart& start, double length, double radius, double grade, std::uint64_t seed,
                       const std::string& name) {
  constexpr double kWidest = std::numbers::pi / 3.0;
  std::uint64_t key = 81;
  for (const char c : name) key = mix(key, static_cast<std::uint64_t>(c));
  const RandomStream random(seed, key);
  std::vector<LineElement> elements;
  double left = length;
  double turned = 0.0;
  const auto add = [&](double wanted, double from, double to, double slope) {
    const double l = std::min(wanted, left);
    if (l <= 0.0) return;
    // An element cut short by the end keeps its rate of curvature.
    const double reached = from + (to - from) * l / wanted;
    elements.push_back({l, from, reached, slope});
    turned += 0.5 * (from + reached) * l;
    left -= l;
  };
  for (std::uint64_t k = 0; left > 0.0; k += 8) {
    const double slope = random.uniform(k, -grade, grade);
    add(random.uniform(k + 1, 40.0, 200.0), 0.0, 0.0, slope);
    const double curve = radius * random.uniform(k + 2, 1.0, 5.0);
    const double clothoid = random.uniform(k + 3, 30.0, 80.0);
    const double side = turned > 0.3 ? -1.0 : turned < -0.3 ? 1.0 : random.uniform(k + 4) < 0.5 ? -1.0 : 1.0;
    const double room = std::max(0.0, (kWidest - side * turned) * curve - clothoid);
    const double arc = std::min(random.uniform(k + 5, 40.0, 250.0), room);
    if (arc < 1.0) continue;
    add(clothoid, 0.0, side / curve, slope);
    add(arc, side / curve, side / curve, slope);
    add(clothoid, side / curve, 0.0, slope);
  }
  return CenterLine(start, elements);
}

void add_passage(WorldDescription& world, std::size_t from, std::size_t to, double at, double width, double height) {
  const VolumeDescription& a = world.volumes[from];
  const VolumeDescription& b = world.volumes[to];
  const LineCoordinates other = b.line.project(a.line.at(at).position);
  const double side = other.l > 0.0 ? -1.0 : 1.0;  // the side of a on which b lies, for lines of like direction
  const double heading = a.line.at(at).heading + side * std::numbers::pi / 2.0;
  const Eigen::Vector3d direction(std::cos(heading), std::sin(heading), 0.0);
  const auto wall = [](const VolumeDescription& v) {
    return std::abs(v.profile.at(v.profile.u_at_height(1.2, 1.0)).x());
  };
  const double begin = wall(a) - 0.8;
  const double gap = (b.line.at(other.s).position - a.line.at(at).position).head<2>().norm();
  const double length = gap - begin - wall(b) + 0.8;
  const double z0 = a.line.at(at).position.z() + 0.16;
  const double z1 = b.line.at(other.s).position.z() + 0.16;
  const Eigen::Vector3d start = a.line.at(at).position + begin * direction;
  VolumeDescription passage;
  passage.name = a.name + "-" + b.name;
  passage.line = CenterLine({start.x(), start.y(), z0, heading}, {{length, 0.0, 0.0, (z1 - z0) / length, 0.0}});
  passage.profile = arch_profile(width, height, Material::shotcrete, Material::concrete);
  passage.lining = {Material::shotcrete, 0.01, 0.5, 0.0};
  passage.equipment = equipment_of(VolumeKind::room, 0);
  world.volumes.push_back(passage);
}

}  // namespace adit::tunnel_simulator
