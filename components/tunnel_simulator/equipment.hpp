// The things on a tunnel's walls: lamps, signs, cable tray, pipe, cabinets, hydrants, jet fans, rails, rubble, trees.
#pragma once

#include <functional>

#include "components/tunnel_simulator/mesh.hpp"
#include "components/tunnel_simulator/world_description.hpp"

namespace adit::tunnel_simulator {

// A lamp or a sign: where it is and how warm. Shared by the geometry and by the painted texture.
struct Fixture {
  double s = 0.0;
  double u = 0.0;            // arc length along the profile
  double length = 0.0;       // along the axis [m]
  double width = 0.0;        // along the profile
  float temperature = 0.0F;  // kelvin above the wall
};
// Those with station in [begin, end). Temperatures are those of a running installation; the texture level decides
// whether they are used.
std::vector<Fixture> lamps(const WorldDescription& world, const VolumeDescription& volume, double begin, double end);
std::vector<Fixture> signs(const WorldDescription& world, const VolumeDescription& volume, double begin, double end);

// Appends the equipment with station in [begin, end) in world coordinates. `neighbour_field` is negative where another
// volume opens: nothing is hung there.
void add_equipment(Mesh& mesh, const WorldDescription& world, const VolumeDescription& volume, double begin, double end,
                   const std::function<double(const Eigen::Vector3d&)>& neighbour_field);

}  // namespace adit::tunnel_simulator
