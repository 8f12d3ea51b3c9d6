#include "components/tunnel_simulator/scenario_loader.hpp"

#include <cmath>
#include <filesystem>
#include <numbers>

#include "components/tunnel_simulator/world.hpp"
#include "components/tunnel_simulator/yaml_reader.hpp"

namespace adit::tunnel_simulator {
namespace {

const std::vector<std::string> kSensorNames{"lidar", "thermal", "imu", "gnss"};

const VolumeDescription* find_tube(YamlMap& map, const std::string& key, const WorldDescription& world) {
  map.require(key);
  const std::string name = map.text(key, "");
  for (const VolumeDescription& v : world.volumes) {
    if (v.name == name) return &v;
  }
  map.fail("the world has no tube '" + name + "'", key);
  return nullptr;
}

RouteLeg read_leg(YamlMap& map, const WorldDescription& world) {
  RouteLeg leg;
  const VolumeDescription* tube = find_tube(map, "tube", world);
  const double length = tube != nullptr ? tube->line.length() : 1e6;
  if (tube != nullptr) leg.line = tube->line;
  leg.from = map.number("from", 0.0, 0.0, 1e6);
  leg.to = map.number("to", length, 0.0, 1e6);
  leg.offset = map.number("offset", 0.0, -100.0, 100.0);
  for (const char* key : {"from", "to"}) {
    if (map.has(key) && (std::string(key) == "from" ? leg.from : leg.to) > length) {
      map.fail("beyond the end of the tube, which is " + std::to_string(length) + " m long", key);
    }
  }
  if (leg.from == leg.to) map.fail("from and to are the same station");
  return leg;
}

void read_route(YamlMap map, const WorldDescription& world, bool imported, Scenario& scenario) {
  scenario.closed = map.boolean("closed", false);
  map.require("legs");
  std::vector<YamlMap> legs = map.maps("legs");
  for (YamlMap& leg : legs) {
    scenario.route.push_back(read_leg(leg, world));
    leg.finish();
  }
  map.finish();
  if (scenario.route.empty()) map.fail("needs at least one leg", "legs");
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
      legs[i].fail(d <= leg_length ? "the route leaves the tunnel " + std::to_string(static_cast<int>(d)) + where
                                   : "the curve from this leg to the next leaves the tunnel " +
                                         std::to_string(static_cast<int>(d)) + where);
      return;
    }
    begin += total;
  }
}

void read_motion(YamlMap map, MotionConfig& m) {
  m.kind = static_cast<VehicleKind>(map.choice("kind", 0, {"car", "legged"}));
  const bool car = m.kind == VehicleKind::car;
  m.speed = map.number("speed", car ? 10.0 : 1.2, 0.05, 60.0);
  m.acceleration = map.number("acceleration", car ? 1.5 : 0.6, 0.05, 10.0);
  m.braking = map.number("braking", car ? 2.0 : 0.8, 0.05, 10.0);
  m.lateral = map.number("lateral", car ? 2.0 : 1.0, 0.05, 10.0);
  m.standing = map.number("standing", m.standing, 0.0, 600.0);
  m.stride = map.number("stride", m.stride, 0.1, 2.0);
  m.sway = map.number("sway", m.sway, 0.0, 5.0);
  for (YamlMap& e : map.maps("events")) {
    MotionEvent event;
    e.require("at");
    event.at = e.number("at", 0.0, 0.0, 1e6);
    event.stop = e.number("stop", 0.0, 0.0, 600.0);
    event.reverse = e.number("reverse", 0.0, 0.0, 500.0);
    event.speed = e.number("speed", -1.0, 0.05, 60.0);
    event.braking = e.number("braking", -1.0, 0.05, 10.0);
    if (event.stop <= 0.0 && event.reverse <= 0.0 && event.speed < 0.0 && event.braking < 0.0)
      e.fail("nothing happens: give stop, reverse, speed or braking");
    e.finish();
    m.events.push_back(event);
  }
  map.finish();
}

void read_lidar(YamlMap map, Scenario& s) {
  LidarConfig& c = s.lidar;
  s.lidar_on = map.boolean("enabled", true);
  const std::string model = map.text("model", "os2_paper");
  const int columns = map.integer("columns", 0, 0, 4096);
  auto beams = beam_table(model, columns);
  if (beams)
    c.beams = std::move(*beams);
  else
    map.fail(beams.error().message, "model");
  c.rate = map.number("rate", c.rate, 1.0, 40.0);
  c.min_range = map.number("min_range", c.min_range, 0.0, 10.0);
  c.max_range = map.number("max_range", c.max_range, 5.0, 400.0);
  c.range_sigma = map.number("range_sigma", c.range_sigma, 0.0, 1.0);
  c.range_sigma_weak = map.number("range_sigma_weak", c.range_sigma_weak, 0.0, 2.0);
  c.detection_range = map.number("detection_range", c.detection_range, 5.0, 400.0);
  c.divergence = map.number("divergence", c.divergence, 0.0, 0.05);
  c.quantum = map.number("quantum", c.quantum, 0.0, 0.1);
  c.false_alarm = map.number("false_alarm", c.false_alarm, 0.0, 0.1);
  c.noise = map.boolean("noise", c.noise);
  c.edges = map.boolean("edges", c.edges);
  map.finish();
}

void read_thermal(YamlMap map, Scenario& s) {
  ThermalConfig& c = s.thermal;
  s.thermal_on = map.boolean("enabled", true);
  const int width = map.integer("width", 640, 32, 1280);
  const int height = map.integer("height", 512, 32, 1024);
  c.camera = CameraModel::from_hfov(width, height, map.number("hfov", 75.0 * std::numbers::pi / 180.0, 0.1, 2.2));
  const std::vector<double> distortion = map.numbers("distortion", 5, -1.0, 1.0);
  if (distortion.size() == 5) {
    c.camera.k1 = distortion[0];
    c.camera.k2 = distortion[1];
    c.camera.p1 = distortion[2];
    c.camera.p2 = distortion[3];
    c.camera.k3 = distortion[4];
  }
  c.rate = map.number("rate", c.rate, 1.0, 120.0);
  c.row_time = map.number("row_time", c.row_time, 0.0, 1e-3);
  c.time_constant = map.number("time_constant", c.time_constant, 0.0, 0.1);
  c.blur = map.number("blur", c.blur, 0.0, 5.0);
  c.counts_per_kelvin = map.number("counts_per_kelvin", c.counts_per_kelvin, 1.0, 1000.0);
  c.counts_at_wall = map.number("counts_at_wall", c.counts_at_wall, 0.0, 16383.0);
  c.netd = map.number("netd", c.netd, 0.0, 2.0);
  c.column_noise = map.number("column_noise", c.column_noise, 0.0, 2.0);
  c.pattern = map.number("pattern", c.pattern, 0.0, 2.0);
  c.pattern_growth = map.number("pattern_growth", c.pattern_growth, 0.0, 2.0);
  c.drift = map.number("drift", c.drift, 0.0, 10.0);
  YamlMap ffc = map.map("ffc");
  if (!ffc.boolean("enabled", true)) c.ffc_first = -1.0;
  const double first = ffc.number("first", 60.0, 0.0, 1e6);
  if (c.ffc_first >= 0.0) c.ffc_first = first;
  c.ffc_interval = ffc.number("interval", c.ffc_interval, 1.0, 1e6);
  c.ffc_duration = ffc.number("duration", c.ffc_duration, 0.0, 10.0);
  ffc.finish();
  c.noise = map.boolean("noise", c.noise);
  c.edges = map.boolean("edges", c.edges);
  map.finish();
  if (c.row_time * height > 1.0 / c.rate) map.fail("the readout (row_time * height) is longer than a frame");
}

void read_imu(YamlMap map, Scenario& s) {
  ImuConfig& c = s.imu;
  s.imu_on = map.boolean("enabled", true);
  c.rate = map.number("rate", c.rate, 10.0, 1000.0);
  c.gyro_noise = map.number("gyro_noise", c.gyro_noise, 0.0, 1.0);
  c.gyro_bias = map.number("gyro_bias", c.gyro_bias, 0.0, 1.0);
  c.gyro_walk = map.number("gyro_walk", c.gyro_walk, 0.0, 1.0);
  c.accel_noise = map.number("accel_noise", c.accel_noise, 0.0, 10.0);
  c.accel_bias = map.number("accel_bias", c.accel_bias, 0.0, 10.0);
  c.accel_walk = map.number("accel_walk", c.accel_walk, 0.0, 10.0);
  c.noise = map.boolean("noise", c.noise);
  map.finish();
}

void read_gnss(YamlMap map, Scenario& s) {
  GnssConfig& c = s.gnss;
  s.gnss_on = map.boolean("enabled", true);
  c.rate = map.number("rate", c.rate, 0.1, 20.0);
  c.latency = map.number("latency", c.latency, 0.0, 2.0);
  c.multipath = map.number("multipath", c.multipath, 0.0, 100.0);
  map.finish();
}

void read_pose(YamlMap map, Pose& pose, bool optical) {
  const Eigen::Vector3d t = pose.translation();
  pose.translation() = Eigen::Vector3d(map.number("x", t.x(), -20.0, 20.0), map.number("y", t.y(), -20.0, 20.0),
                                       map.number("z", t.z(), -20.0, 20.0));
  const double roll = map.number("roll", 0.0, -4.0, 4.0);
  const double pitch = map.number("pitch", 0.0, -4.0, 4.0);
  const double yaw_angle = map.number("yaw", 0.0, -4.0, 4.0);
  const Eigen::Matrix3d turn =
      (Eigen::AngleAxisd(yaw_angle, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  pose.linear() = optical ? Eigen::Matrix3d(turn * optical_axes()) : turn;
  map.finish();
}

void read_troubles(YamlMap& root, Scenario& s) {
  for (YamlMap& a : root.maps("atmosphere")) {
    Smoke smoke;
    const VolumeDescription* tube = find_tube(a, "tube", s.world);
    smoke.tube = tube != nullptr ? tube->name : "";
    const double length = tube != nullptr ? tube->line.length() : 1e6;
    smoke.from = a.number("from", 0.0, 0.0, length);
    smoke.to = a.number("to", length, 0.0, length);
    smoke.ramp = a.number("ramp", smoke.ramp, 0.0, 1e4);
    smoke.kind = static_cast<Obscurant>(a.choice("kind", 0, {"soot", "fog"}));
    a.require("visibility");
    smoke.visibility = a.number("visibility", smoke.visibility, 0.1, 1e5);
    if (smoke.to <= smoke.from) a.fail("'to' must be greater than 'from'");
    a.finish();
    s.smoke.push_back(smoke);
  }
  for (YamlMap& o : root.maps("outages")) {
    Outage outage;
    o.require("sensor");
    o.require("from");
    o.require("duration");
    outage.sensor = static_cast<Sensor>(o.choice("sensor", 0, kSensorNames));
    outage.mode = static_cast<OutageMode>(o.choice("mode", 0, {"off", "frozen", "delayed", "lossy"}));
    outage.from = o.number("from", 0.0, 0.0, 1e6);
    outage.duration = o.number("duration", 1.0, 0.0, 1e6);
    outage.delay = o.number("delay", outage.delay, 0.0, 60.0);
    outage.loss = o.number("loss", outage.loss, 0.0, 1.0);
    o.finish();
    s.outages.push_back(outage);
  }
  YamlMap timing = root.map("timing");
  s.timing[static_cast<std::size_t>(Sensor::gnss)] = {0.0, 0.0, 0.5 * s.gnss.latency, 1.5 * s.gnss.latency, 0.0};
  for (std::size_t i = 0; i < kSensors; ++i) {
    YamlMap t = timing.map(kSensorNames[i]);
    Timing& out = s.timing[i];
    out.offset = t.number("offset", out.offset, -1.0, 1.0);
    out.jitter = t.number("jitter", out.jitter, 0.0, 0.2);
    const std::vector<double> latency = t.numbers("latency", 2, 0.0, 10.0);
    if (latency.size() == 2) {
      out.latency_low = latency[0];
      out.latency_high = std::max(latency[0], latency[1]);
    }
    out.loss = t.number("loss", out.loss, 0.0, 1.0);
    t.finish();
  }
  timing.finish();
  for (YamlMap& v : root.maps("traffic")) {
    TrafficVehicle vehicle;
    vehicle.leg = read_leg(v, s.world);
    vehicle.start = v.number("start", 0.0, 0.0, 1e6);
    vehicle.speed = v.number("speed", vehicle.speed, 0.0, 60.0);
    vehicle.truck = v.boolean("truck", false);
    v.finish();
    s.traffic.push_back(vehicle);
  }
}

}  // namespace

Result<Scenario> load_scenario(const std::string& path) {
  YamlDocument document(path);
  YamlMap root = document.root("scenario");
  Scenario s;
  root.require("name");
  root.require("world");
  root.require("route");
  s.name = root.text("name", "");
  s.description = root.text("description", "");
  s.seed = static_cast<std::uint64_t>(root.integer("seed", 1, 0, 2000000000));
  const int world_seed = root.integer("world_seed", 1, 0, 2000000000);
  const auto features = static_cast<int>(root.choice("features", 2, {"F0", "F1", "F2"}));
  const auto texture = static_cast<int>(root.choice("texture", 2, {"TT0", "TT1", "TT2", "TT3"}));
  s.duration = root.number("duration", s.duration, 0.5, 1e5);
  s.epoch = root.number("epoch", s.epoch, 0.0, 4e9);
  s.view_radius = root.number("view_radius", s.view_radius, 20.0, 500.0);
  const std::string world = root.text("world", "");
  const std::string import = root.text("import", "");
  if (!document.ok()) return document.error();
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  auto loaded = load_world((folder / world).string(), features, texture, static_cast<std::uint64_t>(world_seed));
  if (!loaded) {
    if (loaded.error().code != ErrorCode::not_found) return loaded.error();
    root.fail(loaded.error().message, "world");
    return document.error();
  }
  s.world = std::move(*loaded);
  if (!import.empty()) s.import = (folder / import).string();

  read_motion(root.map("motion"), s.motion);
  YamlMap sensors = root.map("sensors");
  read_lidar(sensors.map("lidar"), s);
  read_thermal(sensors.map("thermal"), s);
  read_imu(sensors.map("imu"), s);
  read_gnss(sensors.map("gnss"), s);
  sensors.finish();
  s.rig = default_rig(s.motion.kind);
  YamlMap rig = root.map("rig");
  if (rig.has("lidar")) read_pose(rig.map("lidar"), s.rig.lidar, false);
  if (rig.has("thermal")) read_pose(rig.map("thermal"), s.rig.thermal, true);
  if (rig.has("imu")) read_pose(rig.map("imu"), s.rig.imu, false);
  const std::vector<double> antenna = rig.numbers("antenna", 3, -20.0, 20.0);
  if (antenna.size() == 3) s.rig.antenna = {antenna[0], antenna[1], antenna[2]};
  rig.finish();
  read_troubles(root, s);
  if (document.ok()) read_route(root.map("route"), s.world, !s.import.empty(), s);
  root.finish();
  if (!document.ok()) return document.error();
  return s;
}

}  // namespace adit::tunnel_simulator
