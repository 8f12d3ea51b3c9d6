// One run: world, route, motion, sensors and what goes wrong. Plain values; scenario_loader.hpp reads them from YAML.
#pragma once

#include <string>
#include <vector>

#include "components/tunnel_simulator/atmosphere.hpp"
#include "components/tunnel_simulator/gnss.hpp"
#include "components/tunnel_simulator/imu.hpp"
#include "components/tunnel_simulator/lidar.hpp"
#include "components/tunnel_simulator/motion.hpp"
#include "components/tunnel_simulator/thermal_camera.hpp"
#include "components/tunnel_simulator/world_description.hpp"

namespace adit::tunnel_simulator {

enum class Sensor : std::uint8_t { lidar, thermal, imu, gnss };
constexpr std::size_t kSensors = 4;

enum class OutageMode : std::uint8_t {
  off,      // nothing comes
  frozen,   // the last sample comes again and again, with fresh stamps
  delayed,  // arrives `delay` late
  lossy,    // a share of the samples is lost
};

struct Outage {
  Sensor sensor = Sensor::lidar;
  OutageMode mode = OutageMode::off;
  double from = 0.0, duration = 0.0;  // [s]
  double delay = 0.5;                 // [s]
  double loss = 0.5;                  // share
};

// Imperfect stamps of one sensor for the whole run.
struct Timing {
  double offset = 0.0;                           // constant error of the stamp [s]
  double jitter = 0.0;                           // rms error of the stamp [s]
  double latency_low = 0.0, latency_high = 0.0;  // between the end of the measurement and its arrival [s]
  double loss = 0.0;                             // share of samples lost
};

struct Smoke {
  std::string tube;
  double from = 0.0, to = 0.0, ramp = 10.0;
  Obscurant kind = Obscurant::soot;
  double visibility = 10.0;
};

struct Rig {  // base_link <- sensor
  Pose lidar = Pose::Identity(), thermal = Pose::Identity(), imu = Pose::Identity();
  Eigen::Vector3d antenna = Eigen::Vector3d::Zero();
};

struct TrafficVehicle {
  RouteLeg leg;         // repeats from its begin
  double start = 0.0;   // along the leg [m]
  double speed = 15.0;  // [m/s]
  bool truck = false;
};

struct Scenario {
  std::string name, description;
  WorldDescription world;
  std::string import;  // mesh file that replaces the procedural world; empty: none
  std::vector<RouteLeg> route;
  bool closed = false;
  MotionConfig motion;
  double duration = 60.0;
  double epoch = 1000.0;  // stamp of the first instant [s]
  std::uint64_t seed = 1;
  bool lidar_on = true, thermal_on = true, imu_on = true, gnss_on = true;
  LidarConfig lidar;
  ThermalConfig thermal;
  ImuConfig imu;
  GnssConfig gnss;
  Rig rig;
  std::vector<Smoke> smoke;
  std::vector<Outage> outages;
  std::array<Timing, kSensors> timing{};
  std::vector<TrafficVehicle> traffic;
  double view_radius = 200.0;  // chunks nearer than this exist [m]
};

// Sensor mounting of the two vehicles.
Rig default_rig(VehicleKind kind);
// Sensor axes forward-left-up to optical axes right-down-forward.
Eigen::Matrix3d optical_axes();

}  // namespace adit::tunnel_simulator
