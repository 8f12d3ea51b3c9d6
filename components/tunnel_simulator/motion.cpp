#include "components/tunnel_simulator/motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "components/tunnel_simulator/random.hpp"

namespace adit::tunnel_simulator {
namespace {

constexpr double kStep = 0.02;  // of the speed's knots [s]
constexpr double kPi = std::numbers::pi;

// Moving mean over 2 * half + 1 samples; three of them make a smooth bell.
std::vector<double> box_filter(const std::vector<double>& in, int half) {
  std::vector<double> sums(in.size() + 1, 0.0);
  for (std::size_t i = 0; i < in.size(); ++i) sums[i + 1] = sums[i] + in[i];
  std::vector<double> out(in.size());
  const auto n = static_cast<int>(in.size());
  for (int i = 0; i < n; ++i) {
    const int a = std::max(0, i - half);
    const int b = std::min(n - 1, i + half);
    out[static_cast<std::size_t>(i)] =
        (sums[static_cast<std::size_t>(b + 1)] - sums[static_cast<std::size_t>(a)]) / (b - a + 1);
  }
  return out;
}

Eigen::Matrix3d heading_frame(const Eigen::Vector3d& tangent) {
  Eigen::Matrix3d r;
  const Eigen::Vector3d left = Eigen::Vector3d::UnitZ().cross(tangent).normalized();
  r << tangent, left, tangent.cross(left);
  return r;
}

Eigen::Matrix3d small_rotation(double roll, double pitch, double yaw) {
  return (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

}  // namespace

Motion::Motion(const MotionConfig& config, const Route& route, double duration, std::uint64_t seed)
    : config_(config), route_(route), seed_(seed) {
  plan(duration);
}

void Motion::plan(double duration) {
  // Greatest speed at each place that curves and the braking before them allow, over what the duration can reach.
  const double grid = 0.5;
  double top = config_.speed;
  for (const MotionEvent& e : config_.events) top = std::max(top, e.speed);
  const double reach = route_.closed() ? top * duration + 50.0 : route_.length();
  std::vector<double> limit(static_cast<std::size_t>(reach / grid) + 2);
  for (std::size_t i = 0; i < limit.size(); ++i) {
    const double curvature = std::abs(route_.at(static_cast<double>(i) * grid).curvature);
    limit[i] = curvature > 1e-9 ? std::min(top, std::sqrt(config_.lateral / curvature)) : top;
  }
  for (std::size_t i = limit.size() - 1; i-- > 0;) {
    limit[i] = std::min(limit[i], std::sqrt(limit[i + 1] * limit[i + 1] + 2.0 * config_.braking * grid));
  }

  std::vector<MotionEvent> events = config_.events;
  std::sort(events.begin(), events.end(), [](const auto& a, const auto& b) { return a.at < b.at; });
  if (!route_.closed()) events.push_back({route_.length() - 0.5, 1e9});
  std::size_t next = 0;
  double wanted = config_.speed;
  double braking = config_.braking;
  double speed = 0.0;
  double distance = 0.0;
  double hold = config_.standing;
  double reverse_to = -1.0;
  std::vector<double> raw;
  for (double t = 0.0; t < duration + 2.0; t += kStep) {
    raw.push_back(hold > 0.0 ? 0.0 : speed);
    if (hold > 0.0) {
      hold -= kStep;
      speed = 0.0;
      continue;
    }
    distance += speed * kStep;
    if (reverse_to >= 0.0) {  // drive back, slowly, then stand a moment
      const double left = distance - reverse_to;
      const double allowed = -std::min(0.3 * wanted, std::sqrt(2.0 * braking * std::max(0.0, left)));
      speed = std::max(speed - config_.acceleration * kStep, allowed);
      if (left < 0.02) {
        reverse_to = -1.0;
        hold = 1.0;
      }
      continue;
    }
    while (next < events.size() && events[next].stop <= 0.0 && events[next].reverse <= 0.0 &&
           distance >= events[next].at) {
      if (events[next].speed >= 0.0) wanted = events[next].speed;
      if (events[next].braking > 0.0) braking = events[next].braking;
      ++next;
    }
    double allowed = std::min(wanted, limit[std::min(limit.size() - 1, static_cast<std::size_t>(distance / grid))]);
    if (next < events.size() && (events[next].stop > 0.0 || events[next].reverse > 0.0)) {
      const MotionEvent& e = events[next];
      const double left = e.at - distance;
      allowed = std::min(allowed, std::sqrt(2.0 * braking * std::max(0.0, left)));
      if (left < 0.02) {
        hold = std::max(0.5, e.stop);
        if (e.reverse > 0.0) reverse_to = std::max(0.0, distance - e.reverse);
        if (e.speed >= 0.0) wanted = e.speed;
        if (e.braking > 0.0) braking = e.braking;
        ++next;
        continue;
      }
      allowed = std::max(allowed, 0.05);  // creep onto the mark
    }
    speed = std::clamp(allowed, speed - 1.2 * braking * kStep, speed + config_.acceleration * kStep);
  }
  for (int i = 0; i < 3; ++i) raw = box_filter(raw, 5);
  speeds_ = std::move(raw);
  // Integral of the B-spline over a knot interval: weights 1/24, 11/24, 11/24, 1/24 of its four control values.
  distances_.assign(1, 0.0);
  for (std::size_t i = 0; i + 3 < speeds_.size(); ++i) {
    distances_.push_back(distances_.back() +
                         kStep / 24.0 * (speeds_[i] + 11.0 * (speeds_[i + 1] + speeds_[i + 2]) + speeds_[i + 3]));
  }
}

Motion::Basis Motion::locate(double time) const {
  const double x = std::clamp(time / kStep, 0.0, static_cast<double>(speeds_.size() - 4));
  const auto i = std::min(static_cast<std::size_t>(x), speeds_.size() - 4);
  return {i, x - static_cast<double>(i)};
}

double Motion::speed(double time) const {
  const auto [i, f] = locate(time);
  const double g = 1.0 - f;
  return (speeds_[i] * g * g * g + speeds_[i + 1] * (3.0 * f * f * f - 6.0 * f * f + 4.0) +
          speeds_[i + 2] * (-3.0 * f * f * f + 3.0 * f * f + 3.0 * f + 1.0) + speeds_[i + 3] * f * f * f) /
         6.0;
}

double Motion::acceleration(double time) const {
  const auto [i, f] = locate(time);
  const double g = 1.0 - f;
  return (-speeds_[i] * g * g + speeds_[i + 1] * (3.0 * f * f - 4.0 * f) +
          speeds_[i + 2] * (-3.0 * f * f + 2.0 * f + 1.0) + speeds_[i + 3] * f * f) /
         (2.0 * kStep);
}

double Motion::distance(double time) const {
  const auto [i, f] = locate(time);
  const double f2 = f * f, f3 = f2 * f, f4 = f3 * f;
  const double g = 1.0 - f;
  const double integral = speeds_[i] * (1.0 - g * g * g * g) / 4.0 + speeds_[i + 1] * (0.75 * f4 - 2.0 * f3 + 4.0 * f) +
                          speeds_[i + 2] * (-0.75 * f4 + f3 + 1.5 * f2 + f) + speeds_[i + 3] * f4 / 4.0;
  return distances_[i] + kStep / 6.0 * integral;
}

Pose Motion::pose(double time) const {
  const double d = distance(time);
  const RoutePoint place = route_.at(d);
  return config_.kind == VehicleKind::car ? car(time, place) : legged(time, d, place);
}

// Suspension: a few incommensurable sinusoids that grow with speed, dive under braking, roll in curves.
Pose Motion::car(double time, const RoutePoint& place) const {
  const RandomStream random(seed_, 41);
  const double v = speed(time);
  const double strength = config_.sway * v * v / (v * v + 25.0);
  const auto wave = [&](std::uint64_t channel, double low, double high) {
    double sum = 0.0;
    for (std::uint64_t k = 0; k < 4; ++k) {
      const double f = random.uniform(channel * 16 + k, low, high);
      sum += 0.5 * std::sqrt(2.0) * std::sin(2.0 * kPi * (f * time + random.uniform(channel * 16 + 8 + k)));
    }
    return sum;
  };
  const double degree = kPi / 180.0;
  const double roll = strength * 0.15 * degree * wave(0, 0.8, 2.2) + config_.sway * 0.004 * v * v * place.curvature;
  const double pitch = strength * 0.15 * degree * wave(1, 1.0, 2.5) - config_.sway * 0.004 * acceleration(time) * -1.0;
  const double heave = strength * 0.006 * wave(2, 1.0, 3.0);
  Pose pose = Pose::Identity();
  pose.linear() = heading_frame(place.tangent) * small_rotation(roll, -pitch, 0.0);
  pose.translation() = place.position + Eigen::Vector3d(0.0, 0.0, heave);
  return pose;
}

// A trotting gait: the body bounces twice and sways once a stride; each foot fall sends a short burst through it.
Pose Motion::legged(double time, double distance, const RoutePoint& place) const {
  (void)time;
  const double phase = 2.0 * kPi * distance / config_.stride;
  const double degree = kPi / 180.0;
  const double k = config_.sway;
  const double slow = 2.0 * kPi * distance;
  double burst = 0.0;
  for (int n = 6; n <= 12; n += 2) burst += std::cos(n * phase + 0.3 * n) / n;
  const double roll =
      k * degree * (2.0 * std::sin(phase) + 0.6 * std::sin(2.0 * phase + 0.7) + 0.5 * std::sin(slow / 7.3));
  const double pitch = k * degree * (1.4 * std::sin(2.0 * phase + 1.1) + 0.8 * std::sin(slow / 3.1) + 0.25 * burst);
  const double yaw = k * degree * (1.5 * std::sin(phase + 0.4) + 1.5 * std::sin(slow / 9.7));
  const double up = k * (0.015 * std::sin(2.0 * phase) + 0.0008 * burst);
  const double side = k * (0.012 * std::sin(phase + 0.2) + 0.15 * std::sin(slow / 23.0));
  Pose pose = Pose::Identity();
  const Eigen::Matrix3d frame = heading_frame(place.tangent);
  pose.linear() = frame * small_rotation(roll, pitch, yaw);
  pose.translation() = place.position + side * frame.col(1) + Eigen::Vector3d(0.0, 0.0, up);
  return pose;
}

}  // namespace adit::tunnel_simulator
