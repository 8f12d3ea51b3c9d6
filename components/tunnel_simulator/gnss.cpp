#include "components/tunnel_simulator/gnss.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include "components/tunnel_simulator/noise.hpp"
#include "components/tunnel_simulator/random.hpp"

namespace adit::tunnel_simulator {

void to_geodetic(const GeoOrigin& origin, const Eigen::Vector3d& enu, double& latitude, double& longitude,
                 double& altitude) {
  constexpr double a = 6378137.0, e2 = 6.69437999014e-3;  // WGS 84
  const double phi = origin.latitude * std::numbers::pi / 180.0;
  const double lambda = origin.longitude * std::numbers::pi / 180.0;
  const double sp = std::sin(phi), cp = std::cos(phi), sl = std::sin(lambda), cl = std::cos(lambda);
  const double n = a / std::sqrt(1.0 - e2 * sp * sp);
  const Eigen::Vector3d base((n + origin.altitude) * cp * cl, (n + origin.altitude) * cp * sl,
                             (n * (1.0 - e2) + origin.altitude) * sp);
  Eigen::Matrix3d axes;
  axes << -sl, -sp * cl, cp * cl, cl, -sp * sl, cp * sl, 0.0, cp, sp;
  const Eigen::Vector3d p = base + axes * enu;
  const double r = p.head<2>().norm();
  double lat = std::atan2(p.z(), r * (1.0 - e2));
  double height = 0.0;
  for (int i = 0; i < 6; ++i) {
    const double nn = a / std::sqrt(1.0 - e2 * std::sin(lat) * std::sin(lat));
    height = r / std::cos(lat) - nn;
    lat = std::atan2(p.z(), r * (1.0 - e2 * nn / (nn + height)));
  }
  latitude = lat * 180.0 / std::numbers::pi;
  longitude = std::atan2(p.y(), p.x()) * 180.0 / std::numbers::pi;
  altitude = height;
}

Gnss::Gnss(const GnssConfig& config, const GeoOrigin& origin, std::uint64_t seed)
    : config_(config), origin_(origin), seed_(seed) {}

GnssSample Gnss::sample(const Eigen::Vector3d& antenna, double depth, double time, std::uint64_t index) {
  const RandomStream random(seed_, 401, index);
  GnssSample out;
  out.stamp_ns = std::llround(time * 1e9);
  const double lost_at = RandomStream(seed_, 402).uniform(static_cast<std::uint64_t>(time / 20.0), 0.0, 10.0);
  const bool hidden = depth > lost_at;  // some satellites are still seen through the portal
  if (hidden) blocked_at_ = time;
  const double open_for = started_ ? time - blocked_at_ : 1e9;
  started_ = true;
  if (hidden || open_for < config_.reacquire_single) {
    out.fix = GnssFix::none;
  } else if (open_for < config_.reacquire_float) {
    out.fix = GnssFix::single;
  } else if (open_for < config_.reacquire_fixed || depth > -10.0) {
    out.fix = GnssFix::rtk_float;
  } else {
    out.fix = GnssFix::rtk_fixed;
  }
  if (out.fix == GnssFix::none) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    out.latitude = out.longitude = out.altitude = nan;
    out.enu.setConstant(nan);
    out.sigma.setConstant(nan);
    return out;
  }
  const double sigma = out.fix == GnssFix::rtk_fixed   ? config_.sigma_fixed
                       : out.fix == GnssFix::rtk_float ? config_.sigma_float
                                                       : config_.sigma_single;
  out.sigma = {sigma, sigma, 1.8 * sigma};
  out.enu = antenna;
  const double slow = out.fix == GnssFix::rtk_fixed ? 0.3 : 0.85;  // share of the error that wanders slowly
  const double near = depth > -30.0 ? config_.multipath * (1.0 + depth / 30.0) : 0.0;
  for (int i = 0; i < 3; ++i) {
    const auto seed = static_cast<std::uint32_t>(mix(seed_, 403 + static_cast<std::uint64_t>(i)));
    const double wander = value_noise(static_cast<float>(time / 15.0), 0.5F, seed);
    const double echo = value_noise(static_cast<float>(time / 3.0), 7.5F, seed);
    out.enu[i] +=
        out.sigma[i] * (slow * wander + std::sqrt(1.0 - slow * slow) * random.normal(static_cast<std::uint64_t>(i)));
    out.enu[i] += std::clamp(near, 0.0, config_.multipath) * echo;
  }
  to_geodetic(origin_, out.enu, out.latitude, out.longitude, out.altitude);
  return out;
}

}  // namespace adit::tunnel_simulator
