#include <cmath>

#include "components/tunnel_simulator/choice.hpp"
#include "components/tunnel_simulator/scenario_loader.hpp"

namespace adit::tunnel_simulator {
namespace {

const std::vector<std::string> kMaterials{"concrete",      "shotcrete",  "rock",    "asphalt", "kerb",  "ballast",
                                          "painted_metal", "bare_metal", "plastic", "rubber",  "glass", "vegetation",
                                          "soil",          "sign",       "lamp",    "wood"};

Material material(const YamlSection& map, const std::string& key, Material fallback) {
  return static_cast<Material>(choice(map, key, static_cast<std::size_t>(fallback), kMaterials));
}

Profile read_profile(const YamlSection& map, Material lining) {
  enum Shape { road, arch, round, box, open };
  const auto shape = choice(map, "shape", road, {"road", "arch", "round", "box", "open"});
  const Material floor = material(map, "floor", Material::concrete);
  Profile profile;
  if (shape == road) {
    RoadProfile p;
    p.radius = map.quantity("radius", p.radius, {2.0, 12.0});
    p.crown = map.quantity("crown", p.crown, {3.0, 15.0});
    p.carriageway = map.quantity("carriageway", p.carriageway, {2.0, 16.0});
    p.kerb_height = map.quantity("kerb_height", p.kerb_height, {0.02, 0.5});
    p.wall_radius = map.quantity("wall_radius", p.wall_radius, {2.0, 100.0});
    if (p.crown <= p.radius + p.kerb_height || p.carriageway >= 1.8 * p.radius) {
      map.error("",
                "radius, crown and carriageway do not make a closed section: need crown > radius + kerb_height and "
                "carriageway < 1.8 radius");
    } else {
      profile = road_profile(p, lining);
    }
  } else if (shape == arch || shape == box) {
    const double width = map.quantity("width", 4.0, {0.5, 60.0});
    const double height = map.quantity("height", 4.0, {0.5, 30.0});
    profile = shape == arch ? arch_profile(width, height, lining, floor) : box_profile(width, height, lining, floor);
  } else if (shape == round) {
    const double diameter = map.quantity("diameter", 5.6, {1.0, 20.0});
    const double width = map.quantity("floor_width", 3.0, {0.2, 18.0});
    if (width >= 0.95 * diameter) {
      map.error("floor_width", "floor_width must be less than 0.95 diameter");
    } else {
      profile = round_profile(diameter, width, lining, floor);
    }
  } else {
    const double width = map.quantity("width", 60.0, {5.0, 300.0});
    profile =
        open_profile(width, map.quantity("road", 30.0, {2.0, width - 1.0}), map.quantity("height", 20.0, {1.0, 60.0}));
  }
  return profile;
}

CenterLine read_line(const YamlSection& tube, std::uint64_t seed, const std::string& name) {
  LineStart start;
  const YamlSection at = tube.section("start");
  start.x = at.quantity("x", 0.0, {-1e5, 1e5});
  start.y = at.quantity("y", 0.0, {-1e5, 1e5});
  start.z = at.quantity("z", 0.0, {-1e4, 1e4});
  start.heading = at.quantity("heading", 0.0, {-10.0, 10.0});
  if (tube.has("random_line")) {
    const YamlSection drawn = tube.section("random_line");
    const double length = drawn.quantity("length", 1000.0, {50.0, 2e4});
    const double radius = drawn.quantity("radius", 300.0, {15.0, 1e4});
    const double grade = drawn.quantity("grade", 0.02, {0.0, 0.15});
    return random_line(start, length, radius, grade, seed, name);
  }
  std::vector<LineElement> elements;
  double curvature = 0.0;
  double grade = 0.0;
  for (const YamlSection& item : tube.sections("line")) {
    LineElement e;
    const int kinds = static_cast<int>(item.has("straight")) + static_cast<int>(item.has("arc")) +
                      static_cast<int>(item.has("clothoid"));
    if (kinds != 1) item.error("", "expected exactly one of straight, arc, clothoid");
    const auto radius = [&] {
      const double r = item.quantity("radius", {}, {-1e5, 1e5});
      if (r != 0.0 && std::abs(r) < 5.0)
        item.error("radius", "a radius must be at least 5 m (left positive, right negative, 0 straight)");
      return r == 0.0 ? 0.0 : 1.0 / r;
    };
    if (item.has("straight")) {
      e.length = item.quantity("straight", 1.0, {0.1, 1e5});
      curvature = 0.0;
    } else if (item.has("arc")) {
      e.length = item.quantity("arc", 1.0, {0.1, 1e5});
      curvature = e.curvature_begin = e.curvature_end = radius();
    } else {
      e.length = item.quantity("clothoid", 1.0, {0.1, 1e4});
      e.curvature_begin = curvature;
      curvature = e.curvature_end = radius();
    }
    grade = e.grade = item.quantity("grade", grade, {-0.25, 0.25});
    elements.push_back(e);
  }
  if (elements.empty()) tube.error("line", "a tube needs at least one element: 'line'");
  return CenterLine(start, elements);
}

void read_equipment(const YamlSection& map, Equipment& e) {
  for (const auto& [key, value] : {std::pair<const char*, double*>{"lamps", &e.lamps},
                                   {"signs", &e.signs},
                                   {"niches", &e.niches},
                                   {"lay_bys", &e.lay_bys},
                                   {"cabinets", &e.cabinets},
                                   {"fans", &e.fans},
                                   {"hydrants", &e.hydrants},
                                   {"rubble", &e.rubble}}) {
    *value = map.quantity(key, *value, {0.0, 1e4});
  }
  e.tray = map.flag("tray", e.tray);
  e.pipe = map.flag("pipe", e.pipe);
  e.rails = map.flag("rails", e.rails);
  e.trees = map.flag("trees", e.trees);
}

void read_ends(const YamlSection& tube, const std::string& key, bool& begin, bool& end) {
  for (const std::string& word : tube.texts(key, std::vector<std::string>{})) {
    if (word == "begin")
      begin = true;
    else if (word == "end")
      end = true;
    else
      tube.error(key, "'" + key + "': expected a list of begin and end");
  }
}

VolumeDescription read_tube(const YamlSection& tube, const WorldDescription& world, int features) {
  VolumeDescription v;
  v.name = tube.text("name");
  v.kind = static_cast<VolumeKind>(choice(tube, "kind", 0, {"road", "rail", "gallery", "room", "open"}));
  const YamlSection lining = tube.section("lining");
  static constexpr double kRoughness[] = {0.0, 0.005, 0.012};
  v.lining.material = material(lining, "material", v.kind == VolumeKind::open ? Material::soil : Material::concrete);
  v.lining.roughness =
      lining.quantity("roughness", v.kind == VolumeKind::open ? 0.04 : kRoughness[features], {0.0, 1.0});
  v.lining.correlation = lining.quantity("correlation", 0.5, {0.05, 20.0});
  v.lining.block =
      lining.quantity("block", v.kind == VolumeKind::open || v.kind == VolumeKind::gallery ? 0.0 : 10.0, {0.0, 100.0});
  const Material profile_material = v.kind == VolumeKind::open ? Material::concrete : v.lining.material;
  const bool parallel = tube.has("parallel_to");
  const VolumeDescription* base = nullptr;
  if (parallel) {
    const std::string name = tube.text("parallel_to", "");
    for (const VolumeDescription& other : world.volumes) {
      if (other.name == name) base = &other;
    }
    if (base == nullptr) tube.error("parallel_to", "no tube '" + name + "' above this one");
    const double offset = tube.quantity("offset", 25.0, {-500.0, 500.0});
    if (base != nullptr && tube.ok()) v.line = base->line.parallel(offset);
  } else {
    v.line = read_line(tube, world.seed, v.name);
  }
  if (base != nullptr && !tube.has("profile")) {
    v.profile = base->profile;
  } else {
    if (!tube.has("profile")) tube.error("", "'profile' is missing: give its shape and size");
    v.profile = read_profile(tube.section("profile"), profile_material);
  }
  read_ends(tube, "caps", v.cap_begin, v.cap_end);
  read_ends(tube, "portals", v.portal_begin, v.portal_end);
  v.equipment = equipment_of(v.kind, features);
  read_equipment(tube.section("equipment"), v.equipment);
  return v;
}

}  // namespace

Result<WorldDescription> load_world(const std::string& path, int features, int texture, std::uint64_t seed) {
  const Result<YamlDocument> document = YamlDocument::load(path);
  if (!document) return document.error();
  const YamlSection root = document->root();
  WorldDescription world;
  world.seed = seed;
  world.texture = texture;
  world.name = root.text("name");
  root.text("description", "");
  const YamlSection origin = root.section("origin");
  world.origin.latitude = origin.quantity("latitude", world.origin.latitude, {-89.0, 89.0});
  world.origin.longitude = origin.quantity("longitude", world.origin.longitude, {-180.0, 180.0});
  world.origin.altitude = origin.quantity("altitude", world.origin.altitude, {-500.0, 9000.0});
  const YamlSection temperatures = root.section("temperatures");
  for (const auto& [key, value] : {std::pair<const char*, double*>{"wall", &world.temperatures.wall},
                                   {"air", &world.temperatures.air},
                                   {"sky", &world.temperatures.sky},
                                   {"ground", &world.temperatures.ground},
                                   {"portal", &world.temperatures.portal}}) {
    *value = temperatures.quantity(key, *value, {-60.0, 80.0});
  }
  world.mesh_step = root.quantity("mesh_step", world.mesh_step, {0.05, 2.0});
  for (const YamlSection& tube : root.sections("tubes")) {
    VolumeDescription v = read_tube(tube, world, features);
    for (const VolumeDescription& other : world.volumes) {
      if (other.name == v.name) tube.error("name", "the name '" + v.name + "' is taken");
    }
    world.volumes.push_back(std::move(v));
  }
  for (const YamlSection& p : root.sections("passages")) {
    std::size_t ends[2] = {0, 0};
    for (int i = 0; i < 2; ++i) {
      const char* key = i == 0 ? "from" : "to";
      const std::string name = p.text(key);
      std::size_t& k = ends[i];
      while (k < world.volumes.size() && world.volumes[k].name != name) ++k;
      if (k == world.volumes.size() && !name.empty()) p.error(key, "no tube '" + name + "'");
    }
    const double at = p.quantity("at", 0.0, {0.0, 1e5});
    const double width = p.quantity("width", 3.6, {0.8, 10.0});
    const double height = p.quantity("height", 4.0, {1.5, 8.0});
    if (ends[0] == ends[1]) p.error("", "from and to are the same tube");
    if (!p.ok()) continue;
    if (at > world.volumes[ends[0]].line.length()) {
      p.error("at", "'at': beyond the end of the tube");
    } else {
      add_passage(world, ends[0], ends[1], at, width, height);
    }
  }
  if (root.sections("tubes").empty()) root.error("tubes", "the world needs at least one tube: 'tubes'");
  if (const Result<void> fine = document->finish(); !fine) return fine.error();
  add_niches(world);
  add_lay_bys(world);
  return world;
}

}  // namespace adit::tunnel_simulator
