// A tunnel system as data: what a world file says, after its units and levels are resolved. Plain values, no behaviour.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "components/tunnel_simulator/center_line.hpp"
#include "components/tunnel_simulator/profile.hpp"

namespace adit::tunnel_simulator {

enum class VolumeKind : std::uint8_t {
  road,     // lamps, signs, lane markings, kerbs
  rail,     // rails and sleepers
  gallery,  // adit or service gallery: lamps only
  room,     // cavern, niche, cross passage: no equipment of its own
  open,     // under the sky: apron
};

struct Lining {
  Material material = Material::concrete;
  double roughness = 0.0;    // rms displacement of the wall along its normal [m]
  double correlation = 0.5;  // wavelength of the roughest layer [m]
  double block = 10.0;       // distance of the joints between casting blocks or rings [m]; 0: none
};

// Spacings along the axis [m]; 0: none.
struct Equipment {
  double lamps = 12.0;  // both crown edges of a road, one row elsewhere
  double signs = 25.0;  // alternating walls
  double niches = 0.0;
  double lay_bys = 0.0;
  double cabinets = 0.0;
  double fans = 0.0;
  double hydrants = 0.0;
  double rubble = 0.0;    // mean distance of the pieces
  bool geometry = false;  // false: lamps and signs are only warm patches of the lining
  bool tray = false, pipe = false, rails = false, trees = false;
};

// A swept volume: `profile` along `line`. The world's surface is the boundary of the union of all volumes.
struct VolumeDescription {
  std::string name;
  VolumeKind kind = VolumeKind::room;
  CenterLine line;
  Profile profile;
  Lining lining;
  Equipment equipment;
  bool cap_begin = false, cap_end = false;        // closed by a wall
  bool portal_begin = false, portal_end = false;  // meets the open air there: cold zone
};

// Degrees Celsius; the rest of the simulator works with kelvin above `wall`.
struct Temperatures {
  double wall = 10.0;
  double air = 10.0;
  double sky = -25.0;
  double ground = 6.0;   // of open volumes
  double portal = -4.0;  // kelvin at the portals, fading over 60 m
};

struct GeoOrigin {
  double latitude = 47.5260, longitude = 14.9080, altitude = 1000.0;  // degrees, m: Erzberg, approximately
};

struct WorldDescription {
  std::string name;
  GeoOrigin origin;
  Temperatures temperatures;
  int texture = 2;         // TT level
  std::uint64_t seed = 1;  // of everything random in the world
  double mesh_step = 0.2;  // of rough walls [m]
  std::vector<VolumeDescription> volumes;
};

// The equipment of feature level F0, F1 or F2.
Equipment equipment_of(VolumeKind kind, int feature_level);

// Appends the niches, 2.0 x 1.2 x 2.5 m, alternating walls, that equipment.niches asks for.
void add_niches(WorldDescription& world);
// Appends the lay-bys, 40 m long, 3 m wide, on the right, that equipment.lay_bys asks for (where the tube has room).
void add_lay_bys(WorldDescription& world);
// A line of exactly `length` metres drawn from (seed, name): straights, and arcs between clothoids with radii from
// `radius` to five times that; heading within 60 degrees of the start's, grade within `grade`. Does not cross itself.
CenterLine random_line(const LineStart& start, double length, double radius, double grade, std::uint64_t seed,
                       const std::string& name);
// Appends a passage from station `at` of one volume straight to the axis of the other.
void add_passage(WorldDescription& world, std::size_t from, std::size_t to, double at, double width, double height);

}  // namespace adit::tunnel_simulator
