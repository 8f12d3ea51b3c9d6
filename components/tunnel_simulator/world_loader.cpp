#include <cmath>

#include "components/tunnel_simulator/scenario_loader.hpp"
#include "components/tunnel_simulator/yaml_reader.hpp"

namespace adit::tunnel_simulator {
namespace {

const std::vector<std::string> kMaterials{"concrete",      "shotcrete",  "rock",    "asphalt", "kerb",  "ballast",
                                          "painted_metal", "bare_metal", "plastic", "rubber",  "glass", "vegetation",
                                          "soil",          "sign",       "lamp",    "wood"};

Material material(YamlMap& map, const std::string& key, Material fallback) {
  return static_cast<Material>(map.choice(key, static_cast<std::size_t>(fallback), kMaterials));
}

Profile read_profile(YamlMap map, Material lining) {
  enum Shape { road, arch, round, box, open };
  const auto shape = map.choice("shape", road, {"road", "arch", "round", "box", "open"});
  const Material floor = material(map, "floor", Material::concrete);
  Profile profile;
  if (shape == road) {
    RoadProfile p;
    p.radius = map.number("radius", p.radius, 2.0, 12.0);
    p.crown = map.number("crown", p.crown, 3.0, 15.0);
    p.carriageway = map.number("carriageway", p.carriageway, 2.0, 16.0);
    p.kerb_height = map.number("kerb_height", p.kerb_height, 0.02, 0.5);
    p.wall_radius = map.number("wall_radius", p.wall_radius, 2.0, 100.0);
    if (p.crown <= p.radius + p.kerb_height || p.carriageway >= 1.8 * p.radius) {
      map.fail(
          "radius, crown and carriageway do not make a closed section: need crown > radius + kerb_height and "
          "carriageway < 1.8 radius");
    } else {
      profile = road_profile(p, lining);
    }
  } else if (shape == arch || shape == box) {
    const double width = map.number("width", 4.0, 0.5, 60.0);
    const double height = map.number("height", 4.0, 0.5, 30.0);
    profile = shape == arch ? arch_profile(width, height, lining, floor) : box_profile(width, height, lining, floor);
  } else if (shape == round) {
    const double diameter = map.number("diameter", 5.6, 1.0, 20.0);
    const double width = map.number("floor_width", 3.0, 0.2, 18.0);
    if (width >= 0.95 * diameter) {
      map.fail("floor_width must be less than 0.95 diameter");
    } else {
      profile = round_profile(diameter, width, lining, floor);
    }
  } else {
    const double width = map.number("width", 60.0, 5.0, 300.0);
    profile = open_profile(width, map.number("road", 30.0, 2.0, width - 1.0), map.number("height", 20.0, 1.0, 60.0));
  }
  map.finish();
  return profile;
}

CenterLine read_line(YamlMap& tube, std::uint64_t seed, const std::string& name) {
  LineStart start;
  YamlMap at = tube.map("start");
  start.x = at.number("x", 0.0, -1e5, 1e5);
  start.y = at.number("y", 0.0, -1e5, 1e5);
  start.z = at.number("z", 0.0, -1e4, 1e4);
  start.heading = at.number("heading", 0.0, -10.0, 10.0);
  at.finish();
  if (tube.has("random_line")) {
    YamlMap drawn = tube.map("random_line");
    const double length = drawn.number("length", 1000.0, 50.0, 2e4);
    const double radius = drawn.number("radius", 300.0, 15.0, 1e4);
    const double grade = drawn.number("grade", 0.02, 0.0, 0.15);
    drawn.finish();
    return random_line(start, length, radius, grade, seed, name);
  }
  std::vector<LineElement> elements;
  tube.require("line");
  double curvature = 0.0;
  double grade = 0.0;
  for (YamlMap& item : tube.maps("line")) {
    LineElement e;
    const int kinds = static_cast<int>(item.has("straight")) + static_cast<int>(item.has("arc")) +
                      static_cast<int>(item.has("clothoid"));
    if (kinds != 1) item.fail("expected exactly one of straight, arc, clothoid");
    const auto radius = [&] {
      const double r = item.number("radius", 0.0, -1e5, 1e5);
      if (r != 0.0 && std::abs(r) < 5.0)
        item.fail("a radius must be at least 5 m (left positive, right negative, 0 straight)", "radius");
      return r == 0.0 ? 0.0 : 1.0 / r;
    };
    if (item.has("straight")) {
      e.length = item.number("straight", 1.0, 0.1, 1e5);
      curvature = 0.0;
    } else if (item.has("arc")) {
      e.length = item.number("arc", 1.0, 0.1, 1e5);
      item.require("radius");
      curvature = e.curvature_begin = e.curvature_end = radius();
    } else {
      e.length = item.number("clothoid", 1.0, 0.1, 1e4);
      item.require("radius");
      e.curvature_begin = curvature;
      curvature = e.curvature_end = radius();
    }
    grade = e.grade = item.number("grade", grade, -0.25, 0.25);
    item.finish();
    elements.push_back(e);
  }
  if (elements.empty()) tube.fail("needs at least one element", "line");
  return CenterLine(start, elements);
}

void read_equipment(YamlMap map, Equipment& e) {
  for (const auto& [key, value] : {std::pair<const char*, double*>{"lamps", &e.lamps},
                                   {"signs", &e.signs},
                                   {"niches", &e.niches},
                                   {"lay_bys", &e.lay_bys},
                                   {"cabinets", &e.cabinets},
                                   {"fans", &e.fans},
                                   {"hydrants", &e.hydrants},
                                   {"rubble", &e.rubble}}) {
    *value = map.number(key, *value, 0.0, 1e4);
  }
  e.tray = map.boolean("tray", e.tray);
  e.pipe = map.boolean("pipe", e.pipe);
  e.rails = map.boolean("rails", e.rails);
  e.trees = map.boolean("trees", e.trees);
  map.finish();
}

void read_ends(YamlMap& tube, const std::string& key, bool& begin, bool& end) {
  for (const std::string& word : tube.texts(key)) {
    if (word == "begin")
      begin = true;
    else if (word == "end")
      end = true;
    else
      tube.fail("expected a list of begin and end", key);
  }
}

VolumeDescription read_tube(YamlMap& tube, const WorldDescription& world, int features) {
  VolumeDescription v;
  tube.require("name");
  v.name = tube.text("name", "");
  v.kind = static_cast<VolumeKind>(tube.choice("kind", 0, {"road", "rail", "gallery", "room", "open"}));
  YamlMap lining = tube.map("lining");
  static constexpr double kRoughness[] = {0.0, 0.005, 0.012};
  v.lining.material = material(lining, "material", v.kind == VolumeKind::open ? Material::soil : Material::concrete);
  v.lining.roughness = lining.number("roughness", v.kind == VolumeKind::open ? 0.04 : kRoughness[features], 0.0, 1.0);
  v.lining.correlation = lining.number("correlation", 0.5, 0.05, 20.0);
  v.lining.block =
      lining.number("block", v.kind == VolumeKind::open || v.kind == VolumeKind::gallery ? 0.0 : 10.0, 0.0, 100.0);
  lining.finish();
  const Material profile_material = v.kind == VolumeKind::open ? Material::concrete : v.lining.material;
  const bool parallel = tube.has("parallel_to");
  const VolumeDescription* base = nullptr;
  if (parallel) {
    const std::string name = tube.text("parallel_to", "");
    for (const VolumeDescription& other : world.volumes) {
      if (other.name == name) base = &other;
    }
    if (base == nullptr) tube.fail("no tube '" + name + "' above this one", "parallel_to");
    const double offset = tube.number("offset", 25.0, -500.0, 500.0);
    if (base != nullptr) v.line = base->line.parallel(offset);
  } else {
    v.line = read_line(tube, world.seed, v.name);
  }
  if (base != nullptr && !tube.has("profile")) {
    v.profile = base->profile;
  } else {
    tube.require("profile");
    v.profile = read_profile(tube.map("profile"), profile_material);
  }
  read_ends(tube, "caps", v.cap_begin, v.cap_end);
  read_ends(tube, "portals", v.portal_begin, v.portal_end);
  v.equipment = equipment_of(v.kind, features);
  read_equipment(tube.map("equipment"), v.equipment);
  tube.finish();
  return v;
}

}  // namespace

Result<WorldDescription> load_world(const std::string& path, int features, int texture, std::uint64_t seed) {
  YamlDocument document(path);
  YamlMap root = document.root("world");
  WorldDescription world;
  world.seed = seed;
  world.texture = texture;
  root.require("name");
  world.name = root.text("name", "");
  root.text("description", "");
  YamlMap origin = root.map("origin");
  world.origin.latitude = origin.number("latitude", world.origin.latitude, -89.0, 89.0);
  world.origin.longitude = origin.number("longitude", world.origin.longitude, -180.0, 180.0);
  world.origin.altitude = origin.number("altitude", world.origin.altitude, -500.0, 9000.0);
  origin.finish();
  YamlMap temperatures = root.map("temperatures");
  for (const auto& [key, value] : {std::pair<const char*, double*>{"wall", &world.temperatures.wall},
                                   {"air", &world.temperatures.air},
                                   {"sky", &world.temperatures.sky},
                                   {"ground", &world.temperatures.ground},
                                   {"portal", &world.temperatures.portal}}) {
    *value = temperatures.number(key, *value, -60.0, 80.0);
  }
  temperatures.finish();
  world.mesh_step = root.number("mesh_step", world.mesh_step, 0.05, 2.0);
  root.require("tubes");
  for (YamlMap& tube : root.maps("tubes")) {
    VolumeDescription v = read_tube(tube, world, features);
    for (const VolumeDescription& other : world.volumes) {
      if (other.name == v.name) tube.fail("the name '" + v.name + "' is taken", "name");
    }
    if (!document.ok()) return document.error();
    world.volumes.push_back(std::move(v));
  }
  for (YamlMap& p : root.maps("passages")) {
    std::size_t ends[2] = {0, 0};
    for (int i = 0; i < 2; ++i) {
      const char* key = i == 0 ? "from" : "to";
      p.require(key);
      const std::string name = p.text(key, "");
      std::size_t& k = ends[i];
      while (k < world.volumes.size() && world.volumes[k].name != name) ++k;
      if (k == world.volumes.size()) p.fail("no tube '" + name + "'", key);
    }
    const double at = p.number("at", 0.0, 0.0, 1e5);
    const double width = p.number("width", 3.6, 0.8, 10.0);
    const double height = p.number("height", 4.0, 1.5, 8.0);
    if (ends[0] == ends[1]) p.fail("from and to are the same tube");
    p.finish();
    if (!document.ok()) return document.error();
    if (at > world.volumes[ends[0]].line.length()) p.fail("beyond the end of the tube", "at");
    add_passage(world, ends[0], ends[1], at, width, height);
  }
  if (document.ok() && world.volumes.empty()) root.fail("needs at least one tube", "tubes");
  root.finish();
  if (!document.ok()) return document.error();
  add_niches(world);
  add_lay_bys(world);
  return world;
}

}  // namespace adit::tunnel_simulator
