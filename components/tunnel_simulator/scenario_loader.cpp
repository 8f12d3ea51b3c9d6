#include "components/tunnel_simulator/scenario_loader.hpp"

#include <cmath>
#include <filesystem>
#include <numbers>

#include "components/tunnel_simulator/choice.hpp"
#include "components/tunnel_simulator/world.hpp"

namespace adit::tunnel_simulator {
namespace {

const std::vector<std::string> kSensorNames{"lidar", "thermal", "imu", "gnss"};

const VolumeDescription* find_tube(const YamlSection& map, const std::string& key, const WorldDescription& world) {
  const std::string name = map.text(key);
  for (const VolumeDescription& v : world.volumes) {
    if (v.name == name) return &v;
  }
  if (!name.empty()) map.error(key, "the world has no tube '" + name + "'");
  return nullptr;
}

RouteLeg read_leg(const YamlSection& map, const WorldDescription& world) {
  RouteLeg leg;
  const VolumeDescription* tube = find_tube(map, "tube", world);
  const double length = tube != nullptr ? tube->line.length() : 1e6;
  if (tube != nullptr) leg.line = tube->line;
  leg.from = map.quantity("from", 0.0, {0.0, 1e6});
  leg.to = map.quantity("to", length, {0.0, 1e6});
  leg.offset = map.quantity("offset", 0.0, {-100.0, 100.0});
  for (const char* key : {"from", "to"}) {
    if (map.has(key) && (std::string(key) == "from" ? leg.from : leg.to) > length) {
      map.error(key, "beyond the end of the tube, which is " + std::to_string(length) + " m long");
    }
  }
  if (leg.from == leg.to) map.error("", "from and to are the same station");
  return leg;
}

void read_route(const YamlSection& map, const WorldDescription& world, bool imported, Scenario& scenario) {
  scenario.closed = map.flag("closed", false);
  const std::vector<YamlSection> legs = map.sections("legs");
  for (const YamlSection& leg : legs) scenario.route.push_back(read_leg(leg, world));
  if (scenario.route.empty()) map.error("legs", "'route' needs at least one leg in 'legs'");
  if (!map.ok() || imported) return;
  // Every metre of the way must be inside; the leg or the bridge behind it is named.
  const World volumes(world);
  const Route all(scenario.route, scenario.closed);
  double begin = 0.0;
  for (std::size_t i = 0; i < scenario.route.size(); ++i) {
    const double leg_length = Route({scenario.route[i]}, false).length();
    std::vector<RouteLeg> pair{scenario.route[i], scenario.route[(i + 1) % scenario.route.size()]};
    const bool bridged = i + 1 < scenario.route.size() || scenario.closed;
    const double bridge = bridged ? Route(pair, false).length() - leg_length - Route({pair[1]}, false).length() : 0.0;
    const double total = leg_length + bridge;
    for (double d = 0.0; d < total; d += 1.0) {
      const Eigen::Vector3d place = all.at(begin + d).position + Eigen::Vector3d(0.0, 0.0, 1.2);
      if (volumes.field(place) < -0.3) continue;
      const std::string where =
          " m behind its begin, at (" + std::to_string(place.x()) + ", " + std::to_string(place.y()) + ")";
      legs[i].error("", d <= leg_length ? "the route leaves the tunnel " + std::to_string(static_cast<int>(d)) + where
                                        : "the curve from this leg to the next leaves the tunnel " +
                                              std::to_string(static_cast<int>(d)) + where);
      return;
    }
    begin += total;
  }
}

void read_motion(const YamlSection& map, MotionConfig& m) {
  m.kind = static_cast<VehicleKind>(choice(map, "kind", 0, {"car", "legged"}));
  const bool car = m.kind == VehicleKind::car;
  m.speed = map.quantity("speed", car ? 10.0 : 1.2, {0.05, 60.0});
  m.acceleration = map.quantity("acceleration", car ? 1.5 : 0.6, {0.05, 10.0});
  m.braking = map.quantity("braking", car ? 2.0 : 0.8, {0.05, 10.0});
  m.lateral = map.quantity("lateral", car ? 2.0 : 1.0, {0.05, 10.0});
  m.standing = map.quantity("standing", m.standing, {0.0, 600.0});
  m.stride = map.quantity("stride", m.stride, {0.1, 2.0});
  m.sway = map.quantity("sway", m.sway, {0.0, 5.0});
  for (const YamlSection& e : map.sections("events")) {
    MotionEvent event;
    event.at = e.quantity("at", {}, {0.0, 1e6});
    event.stop = e.quantity("stop", 0.0, {0.0, 600.0});
    event.reverse = e.quantity("reverse", 0.0, {0.0, 500.0});
    event.speed = e.quantity("speed", -1.0, {0.05, 60.0});
    event.braking = e.quantity("braking", -1.0, {0.05, 10.0});
    if (event.stop <= 0.0 && event.reverse <= 0.0 && event.speed < 0.0 && event.braking < 0.0)
      e.error("", "nothing happens: give stop, reverse, speed or braking");
    m.events.push_back(event);
  }
}

void read_lidar(const YamlSection& map, Scenario& s) {
  LidarConfig& c = s.lidar;
  s.lidar_on = map.flag("enabled", true);
  const std::string model = map.text("model", "os2_paper");
  const auto columns = map.integer("columns", 0, {0, 4096});
  auto beams = beam_table(model, static_cast<int>(columns));
  if (beams)
    c.beams = std::move(*beams);
  else
    map.error("model", beams.error().message);
  c.rate = map.quantity("rate", c.rate, {1.0, 40.0});
  c.min_range = map.quantity("min_range", c.min_range, {0.0, 10.0});
  c.max_range = map.quantity("max_range", c.max_range, {5.0, 400.0});
  c.range_sigma = map.quantity("range_sigma", c.range_sigma, {0.0, 1.0});
  c.range_sigma_weak = map.quantity("range_sigma_weak", c.range_sigma_weak, {0.0, 2.0});
  c.detection_range = map.quantity("detection_range", c.detection_range, {5.0, 400.0});
  c.divergence = map.quantity("divergence", c.divergence, {0.0, 0.05});
  c.quantum = map.quantity("quantum", c.quantum, {0.0, 0.1});
  c.false_alarm = map.quantity("false_alarm", c.false_alarm, {0.0, 0.1});
  c.noise = map.flag("noise", c.noise);
  c.edges = map.flag("edges", c.edges);
}

void read_thermal(const YamlSection& map, Scenario& s) {
  ThermalConfig& c = s.thermal;
  s.thermal_on = map.flag("enabled", true);
  const auto width = static_cast<int>(map.integer("width", 640, {32, 1280}));
  const auto height = static_cast<int>(map.integer("height", 512, {32, 1024}));
  c.camera = CameraModel::from_hfov(width, height, map.quantity("hfov", 75.0 * std::numbers::pi / 180.0, {0.1, 2.2}));
  const std::vector<double> distortion = map.quantities("distortion", 5, {-1.0, 1.0});
  if (distortion.size() == 5) {
    c.camera.k1 = distortion[0];
    c.camera.k2 = distortion[1];
    c.camera.p1 = distortion[2];
    c.camera.p2 = distortion[3];
    c.camera.k3 = distortion[4];
  }
  c.rate = map.quantity("rate", c.rate, {1.0, 120.0});
  c.row_time = map.quantity("row_time", c.row_time, {0.0, 1e-3});
  c.time_constant = map.quantity("time_constant", c.time_constant, {0.0, 0.1});
  c.blur = map.quantity("blur", c.blur, {0.0, 5.0});
  c.counts_per_kelvin = map.quantity("counts_per_kelvin", c.counts_per_kelvin, {1.0, 1000.0});
  c.counts_at_wall = map.quantity("counts_at_wall", c.counts_at_wall, {0.0, 16383.0});
  c.netd = map.quantity("netd", c.netd, {0.0, 2.0});
  c.column_noise = map.quantity("column_noise", c.column_noise, {0.0, 2.0});
  c.pattern = map.quantity("pattern", c.pattern, {0.0, 2.0});
  c.pattern_growth = map.quantity("pattern_growth", c.pattern_growth, {0.0, 2.0});
  c.drift = map.quantity("drift", c.drift, {0.0, 10.0});
  const YamlSection ffc = map.section("ffc");
  if (!ffc.flag("enabled", true)) c.ffc_first = -1.0;
  const double first = ffc.quantity("first", 60.0, {0.0, 1e6});
  if (c.ffc_first >= 0.0) c.ffc_first = first;
  c.ffc_interval = ffc.quantity("interval", c.ffc_interval, {1.0, 1e6});
  c.ffc_duration = ffc.quantity("duration", c.ffc_duration, {0.0, 10.0});
  c.noise = map.flag("noise", c.noise);
  c.edges = map.flag("edges", c.edges);
  if (c.row_time * height > 1.0 / c.rate) map.error("", "the readout (row_time * height) is longer than a frame");
}

void read_imu(const YamlSection& map, Scenario& s) {
  ImuConfig& c = s.imu;
  s.imu_on = map.flag("enabled", true);
  c.rate = map.quantity("rate", c.rate, {10.0, 1000.0});
  c.gyro_noise = map.quantity("gyro_noise", c.gyro_noise, {0.0, 1.0});
  c.gyro_bias = map.quantity("gyro_bias", c.gyro_bias, {0.0, 1.0});
  c.gyro_walk = map.quantity("gyro_walk", c.gyro_walk, {0.0, 1.0});
  c.accel_noise = map.quantity("accel_noise", c.accel_noise, {0.0, 10.0});
  c.accel_bias = map.quantity("accel_bias", c.accel_bias, {0.0, 10.0});
  c.accel_walk = map.quantity("accel_walk", c.accel_walk, {0.0, 10.0});
  c.noise = map.flag("noise", c.noise);
}

void read_gnss(const YamlSection& map, Scenario& s) {
  GnssConfig& c = s.gnss;
  s.gnss_on = map.flag("enabled", true);
  c.rate = map.quantity("rate", c.rate, {0.1, 20.0});
  c.latency = map.quantity("latency", c.latency, {0.0, 2.0});
  c.multipath = map.quantity("multipath", c.multipath, {0.0, 100.0});
}

void read_pose(const YamlSection& map, Pose& pose, bool optical) {
  const Eigen::Vector3d t = pose.translation();
  pose.translation() = Eigen::Vector3d(map.quantity("x", t.x(), {-20.0, 20.0}), map.quantity("y", t.y(), {-20.0, 20.0}),
                                       map.quantity("z", t.z(), {-20.0, 20.0}));
  const double roll = map.quantity("roll", 0.0, {-4.0, 4.0});
  const double pitch = map.quantity("pitch", 0.0, {-4.0, 4.0});
  const double yaw_angle = map.quantity("yaw", 0.0, {-4.0, 4.0});
  const Eigen::Matrix3d turn =
      (Eigen::AngleAxisd(yaw_angle, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  pose.linear() = optical ? Eigen::Matrix3d(turn * optical_axes()) : turn;
}

void read_smoke(const YamlSection& root, Scenario& s) {
  for (const YamlSection& a : root.sections("atmosphere")) {
    Smoke smoke;
    const VolumeDescription* tube = find_tube(a, "tube", s.world);
    smoke.tube = tube != nullptr ? tube->name : "";
    const double length = tube != nullptr ? tube->line.length() : 1e6;
    smoke.from = a.quantity("from", 0.0, {0.0, length});
    smoke.to = a.quantity("to", length, {0.0, length});
    smoke.ramp = a.quantity("ramp", smoke.ramp, {0.0, 1e4});
    smoke.kind = static_cast<Obscurant>(choice(a, "kind", 0, {"soot", "fog"}));
    smoke.visibility = a.quantity("visibility", {}, {0.1, 1e5});
    if (smoke.to <= smoke.from) a.error("to", "'to' must be greater than 'from'");
    s.smoke.push_back(smoke);
  }
}

void read_outages(const YamlSection& root, Scenario& s) {
  for (const YamlSection& o : root.sections("outages")) {
    Outage outage;
    if (!o.has("sensor")) o.error("", "'sensor' is missing: give one of lidar, thermal, imu, gnss");
    outage.sensor = static_cast<Sensor>(choice(o, "sensor", 0, kSensorNames));
    outage.mode = static_cast<OutageMode>(choice(o, "mode", 0, {"off", "frozen", "delayed", "lossy"}));
    outage.from = o.quantity("from", {}, {0.0, 1e6});
    outage.duration = o.quantity("duration", {}, {0.0, 1e6});
    outage.delay = o.quantity("delay", outage.delay, {0.0, 60.0});
    outage.loss = o.quantity("loss", outage.loss, {0.0, 1.0});
    s.outages.push_back(outage);
  }
}

void read_timing(const YamlSection& root, Scenario& s) {
  const YamlSection timing = root.section("timing");
  s.timing[static_cast<std::size_t>(Sensor::gnss)] = {0.0, 0.0, 0.5 * s.gnss.latency, 1.5 * s.gnss.latency, 0.0};
  for (std::size_t i = 0; i < kSensors; ++i) {
    const YamlSection t = timing.section(kSensorNames[i]);
    Timing& out = s.timing[i];
    out.offset = t.quantity("offset", out.offset, {-1.0, 1.0});
    out.jitter = t.quantity("jitter", out.jitter, {0.0, 0.2});
    const std::vector<double> latency = t.quantities("latency", 2, {0.0, 10.0});
    if (latency.size() == 2) {
      out.latency_low = latency[0];
      out.latency_high = std::max(latency[0], latency[1]);
    }
    out.loss = t.quantity("loss", out.loss, {0.0, 1.0});
  }
}

void read_traffic(const YamlSection& root, Scenario& s) {
  for (const YamlSection& v : root.sections("traffic")) {
    TrafficVehicle vehicle;
    vehicle.leg = read_leg(v, s.world);
    vehicle.start = v.quantity("start", 0.0, {0.0, 1e6});
    vehicle.speed = v.quantity("speed", vehicle.speed, {0.0, 60.0});
    vehicle.truck = v.flag("truck", false);
    s.traffic.push_back(vehicle);
  }
}

}  // namespace

Result<Scenario> load_scenario(const std::string& path) {
  const Result<YamlDocument> document = YamlDocument::load(path);
  if (!document) return document.error();
  const YamlSection root = document->root();
  Scenario s;
  s.name = root.text("name");
  s.description = root.text("description", "");
  s.seed = static_cast<std::uint64_t>(root.integer("seed", 1, {0, 2000000000}));
  const auto world_seed = static_cast<std::uint64_t>(root.integer("world_seed", 1, {0, 2000000000}));
  const auto features = static_cast<int>(choice(root, "features", 2, {"F0", "F1", "F2"}));
  const auto texture = static_cast<int>(choice(root, "texture", 2, {"TT0", "TT1", "TT2", "TT3"}));
  s.duration = root.quantity("duration", s.duration, {0.5, 1e5});
  s.epoch = root.quantity("epoch", s.epoch, {0.0, 4e9});
  s.view_radius = root.quantity("view_radius", s.view_radius, {20.0, 500.0});
  const std::string import = root.text("import", "");
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (!import.empty()) s.import = (folder / import).string();

  read_motion(root.section("motion"), s.motion);
  const YamlSection sensors = root.section("sensors");
  read_lidar(sensors.section("lidar"), s);
  read_thermal(sensors.section("thermal"), s);
  read_imu(sensors.section("imu"), s);
  read_gnss(sensors.section("gnss"), s);
  s.rig = default_rig(s.motion.kind);
  const YamlSection rig = root.section("rig");
  if (rig.has("lidar")) read_pose(rig.section("lidar"), s.rig.lidar, false);
  if (rig.has("thermal")) read_pose(rig.section("thermal"), s.rig.thermal, true);
  if (rig.has("imu")) read_pose(rig.section("imu"), s.rig.imu, false);
  const std::vector<double> antenna = rig.quantities("antenna", 3, {-20.0, 20.0});
  if (antenna.size() == 3) s.rig.antenna = {antenna[0], antenna[1], antenna[2]};
  read_outages(root, s);
  read_timing(root, s);

  // A mistake in the world file comes alone; without the file, nothing that lies in it can be checked.
  const std::string world = root.text("world");
  if (!world.empty()) {
    auto loaded = load_world((folder / world).string(), features, texture, world_seed);
    if (loaded) {
      s.world = std::move(*loaded);
    } else if (loaded.error().code == ErrorCode::not_found) {
      root.error("world", loaded.error().message);
    } else {
      return loaded.error();
    }
  }
  if (!s.world.volumes.empty()) {
    read_smoke(root, s);
    read_traffic(root, s);
    read_route(root.section("route"), s.world, !s.import.empty(), s);
  } else {
    for (const char* key : {"atmosphere", "traffic", "route"}) static_cast<void>(root.has(key));
  }
  if (const Result<void> fine = document->finish(); !fine) return fine.error();
  return s;
}

}  // namespace adit::tunnel_simulator
