// Worlds whose ranges have closed forms. For tests and benchmarks.
#pragma once

#include "components/tunnel_simulator/world_description.hpp"

namespace adit::tunnel_simulator {

// One straight, smooth, isothermal tube of the given section, `heading` from the start, 100 m long.
inline WorldDescription plain_tube(const Profile& profile, const LineStart& start, double length = 100.0) {
  WorldDescription world;
  world.name = "plain";
  world.texture = 0;
  VolumeDescription v;
  v.name = "main";
  v.line = CenterLine(start, {{length, 0.0, 0.0}});
  v.profile = profile;
  v.lining = {Material::concrete, 0.0, 0.5, 0.0};
  v.equipment.lamps = v.equipment.signs = 0.0;
  v.cap_begin = v.cap_end = true;
  world.volumes.push_back(v);
  return world;
}

}  // namespace adit::tunnel_simulator
