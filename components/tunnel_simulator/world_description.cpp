#include "components/tunnel_simulator/world_description.hpp"

#include <cmath>
#include <numbers>

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
