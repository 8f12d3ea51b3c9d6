// A spinning LiDAR: every column is cast at its own time from its own pose.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "components/geometry/se3.hpp"
#include "components/tunnel_simulator/atmosphere.hpp"
#include "components/tunnel_simulator/random.hpp"
#include "components/tunnel_simulator/ray_caster.hpp"
#include "idl/result.hpp"

namespace adit::tunnel_simulator {

// Where the beams point. Sensor frame: x forward, y left, z up; encoder angle counted from +x towards +y.
struct BeamTable {
  std::vector<double> elevation;       // per ring, rad, top ring first
  std::vector<double> azimuth_offset;  // per ring, rad, added to the column's encoder angle
  std::vector<double> time_offset;     // per ring, s, added to the column's time
  double origin_radius = 0.0;          // of the beam's start, along its azimuth [m]
  int columns = 1024;
};
// "os2_paper" (45 degrees, uniform), "os2_real" (21.85 degrees with beam offsets), "os0" (90), "os1" (45), "vlp16".
Result<BeamTable> beam_table(const std::string& name, int columns = 0);

struct LidarConfig {
  BeamTable beams;
  double rate = 10.0;      // sweeps per second
  double min_range = 0.8;  // [m]
  double max_range = 150.0;
  double range_sigma = 0.025;      // at strong return [m]
  double range_sigma_weak = 0.08;  // at the detection limit
  double detection_range = 100.0;  // where a 10 % target at normal incidence is seen in 90 % of the shots [m]
  double divergence = 1.57e-3;     // full angle [rad]
  double quantum = 0.003;          // range quantisation [m]; 0: none
  double false_alarm = 1e-4;       // returns from nothing, per shot without target
  bool noise = true;               // range noise, dropouts, quantisation, false alarms
  bool edges = true;               // sub-rays where neighbours differ: mixed pixels
};

// Organised: index = ring * columns + column. Missing returns have range 0.
struct LidarScan {
  std::int64_t stamp_ns = 0;  // of the first column
  int rings = 0, columns = 0;
  std::vector<Eigen::Vector3f> points;  // sensor frame at the column's own time
  std::vector<float> ranges;            // along the beam from its start [m]
  std::vector<float> reflectivity;      // calibrated, 0..255: 100 = Lambertian 100 %, above: retroreflector
  std::vector<float> signal;            // received power, arbitrary units
  std::vector<std::uint32_t> time_ns;   // since stamp, by ring and column
  std::size_t returns() const;
};

class Lidar {
 public:
  Lidar(LidarConfig config, std::uint64_t seed);
  const LidarConfig& config() const { return config_; }

  // World <- sensor at a time [s since simulation start].
  using PoseAt = std::function<Pose(double)>;
  // The sweep that begins at `time` and lasts 1 / rate. `frame` numbers the random stream. The caster must be looking
  // from near the sensor. `scan` is reused: no allocation after the first call.
  void sweep(const RayCaster& caster, const Atmosphere& atmosphere, const PoseAt& pose, double time,
             std::uint64_t frame, int threads, LidarScan& scan);
  // Of a column within a sweep [s].
  double column_time(int column) const { return column / (config_.rate * config_.beams.columns); }

 private:
  struct Return {
    double range = 0.0;     // 0: none
    float strength = 0.0F;  // detection-limit units, before extinction
    float reflectivity = 0.0F;
  };
  struct Echo {
    Return part;
    float share = 0.0F;  // of the beam's power
  };
  static Return strongest(std::span<const Echo> echoes);
  Return shade(const RayCaster& caster, const RayPacket& packet, std::size_t lane, const Eigen::Vector3d& from,
               const Eigen::Vector3d& direction) const;
  void cast_columns(const RayCaster& caster, int first, int count);
  void resample_edges(const RayCaster& caster, int ring);
  void detect(const Atmosphere& atmosphere, int ring, std::uint64_t frame, LidarScan& scan) const;
  // The echo of smoke that is stronger than `echo`, or that echo attenuated; its one-way-and-back transmission.
  std::pair<Return, double> through(const Atmosphere& atmosphere, const Return& echo, const RandomStream& random,
                                    std::size_t index) const;
  const Eigen::Vector3d& beam(std::size_t index) const { return beams_[index]; }
  Eigen::Vector3d start(std::size_t index) const {
    return {config_.beams.origin_radius * cos_[index], config_.beams.origin_radius * sin_[index], 0.0};
  }
  std::size_t index_of(int ring, int column) const {
    return static_cast<std::size_t>(ring) * static_cast<std::size_t>(config_.beams.columns) +
           static_cast<std::size_t>(column);
  }

  LidarConfig config_;
  std::uint64_t seed_;
  std::vector<Pose> poses_;      // per column
  std::vector<Return> returns_;  // organised, as all below: [ring * columns + column]
  std::vector<Return> edged_;
  std::vector<Eigen::Vector3d> beams_;  // unit, sensor frame
  std::vector<double> cos_, sin_;       // of the azimuth
};

}  // namespace adit::tunnel_simulator
