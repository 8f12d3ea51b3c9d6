// An RTK receiver (u-blox ZED-F9P) that loses its satellites in the tunnel and is misled by echoes at the portals.
#pragma once

#include <cstdint>

#include "components/tunnel_simulator/world_description.hpp"

namespace adit::tunnel_simulator {

struct GnssConfig {
  double rate = 10.0;                                                            // [Hz]
  double latency = 0.10;                                                         // of the delivery [s]
  double sigma_fixed = 0.012, sigma_float = 0.3, sigma_single = 1.3;             // horizontal, rms per axis [m]
  double multipath = 3.0;                                                        // rms bias within 30 m of a portal [m]
  double reacquire_single = 2.0, reacquire_float = 6.0, reacquire_fixed = 14.0;  // after the exit [s]
};

enum class GnssFix : std::uint8_t { none = 0, single = 1, rtk_fixed = 4, rtk_float = 5 };  // as in NMEA GGA

struct GnssSample {
  std::int64_t stamp_ns = 0;
  GnssFix fix = GnssFix::none;
  double latitude = 0.0, longitude = 0.0, altitude = 0.0;  // degrees, m above the ellipsoid; NaN without a fix
  Eigen::Vector3d enu = Eigen::Vector3d::Zero();           // the same in world coordinates; NaN without a fix
  Eigen::Vector3d sigma = Eigen::Vector3d::Zero();         // what the receiver believes, east north up [m]
};

// World coordinates (east, north, up of the origin; tangent plane with curvature of the ellipsoid) to WGS 84.
void to_geodetic(const GeoOrigin& origin, const Eigen::Vector3d& enu, double& latitude, double& longitude,
                 double& altitude);

// Samples must be taken in order.
class Gnss {
 public:
  Gnss(const GnssConfig& config, const GeoOrigin& origin, std::uint64_t seed);
  const GnssConfig& config() const { return config_; }
  // `depth`: metres behind the nearest portal, negative in the open.
  GnssSample sample(const Eigen::Vector3d& antenna, double depth, double time, std::uint64_t index);

 private:
  GnssConfig config_;
  GeoOrigin origin_;
  std::uint64_t seed_;
  double blocked_at_ = -1e9;  // when the sky was last hidden
  bool started_ = false;
};

}  // namespace adit::tunnel_simulator
