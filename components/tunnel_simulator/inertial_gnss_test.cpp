#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

#include "components/tunnel_simulator/gnss.hpp"
#include "components/tunnel_simulator/imu.hpp"
#include "components/tunnel_simulator/motion.hpp"
#include "components/tunnel_simulator/random.hpp"

namespace adit::tunnel_simulator {
namespace {

TEST(RandomStream, UniformAndNormalMoments) {
  const RandomStream random(5, 6, 7);
  double sum = 0, square = 0, fourth = 0, u = 0, cross = 0;
  const int n = 200000;
  for (std::uint64_t i = 0; i < n; ++i) {
    const auto [a, b] = random.normal_pair(i);
    sum += a;
    square += a * a;
    fourth += static_cast<double>(a) * a * a * a;
    cross += a * b;
    u += random.uniform(i + 1000000);
  }
  EXPECT_NEAR(sum / n, 0.0, 0.01);
  EXPECT_NEAR(square / n, 1.0, 0.02);
  EXPECT_NEAR(fourth / n, 3.0, 0.15);
  EXPECT_NEAR(cross / n, 0.0, 0.01);
  EXPECT_NEAR(u / n, 0.5, 0.003);
}

TEST(Imu, WhiteNoiseHasTheConfiguredDensity) {
  ImuConfig c;
  c.gyro_bias = c.accel_bias = c.gyro_walk = c.accel_walk = 0.0;
  Imu imu(c, 9);
  const Pose still = Pose::Identity();
  const int n = 40000;
  std::vector<double> gyro, accel;
  for (int k = 0; k < n; ++k) {
    const ImuSample s = imu.sample([&](double) { return still; }, k / c.rate, static_cast<std::uint64_t>(k));
    gyro.push_back(s.rate.x());
    accel.push_back(s.acceleration.z() - kGravity);
  }
  // Allan deviation of white noise: density / sqrt(tau), for averaging times of 1 and 16 samples.
  const auto allan = [&](const std::vector<double>& v, int m) {
    double square = 0.0, last = 0.0;
    int count = 0;
    for (int k = 0; k + m <= n; k += m) {
      double mean = 0.0;
      for (int i = 0; i < m; ++i) mean += v[static_cast<std::size_t>(k + i)] / m;
      if (k > 0) {
        square += (mean - last) * (mean - last);
        ++count;
      }
      last = mean;
    }
    return std::sqrt(0.5 * square / count);
  };
  for (int m : {1, 16}) {
    EXPECT_NEAR(allan(gyro, m) * std::sqrt(m / c.rate), c.gyro_noise, 0.05 * c.gyro_noise) << m;
    EXPECT_NEAR(allan(accel, m) * std::sqrt(m / c.rate), c.accel_noise, 0.05 * c.accel_noise) << m;
  }
}

TEST(Imu, BiasWalksAsConfigured) {
  ImuConfig c;
  c.gyro_noise = c.accel_noise = c.gyro_bias = c.accel_bias = 0.0;
  double square = 0.0;
  const int runs = 800, n = 50;
  for (int run = 0; run < runs; ++run) {
    Imu imu(c, static_cast<std::uint64_t>(1000 + run));
    ImuSample s;
    for (int k = 0; k <= n; ++k) {
      s = imu.sample([](double) { return Pose::Identity(); }, k / c.rate, static_cast<std::uint64_t>(k));
    }
    square += s.rate.squaredNorm() / 3.0;
  }
  const double expected = c.gyro_walk * std::sqrt(n / c.rate);
  EXPECT_NEAR(std::sqrt(square / runs), expected, 0.05 * expected);
}

TEST(Imu, CircleFeelsCentripetalAccelerationAndGravity) {
  ImuConfig c;
  c.noise = false;
  Imu imu(c, 1);
  const double radius = 50.0, rate = 0.3;
  const auto pose = [&](double t) {
    Pose p = Pose::Identity();
    p.linear() = Eigen::AngleAxisd(rate * t + 1.5707963267948966, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    p.translation() = Eigen::Vector3d(radius * std::cos(rate * t), radius * std::sin(rate * t), 0.0);
    return p;
  };
  const ImuSample s = imu.sample(pose, 3.0, 0);
  EXPECT_NEAR(s.acceleration.x(), 0.0, 1e-5);
  EXPECT_NEAR(s.acceleration.y(), radius * rate * rate, 1e-5);  // to the left, towards the centre
  EXPECT_NEAR(s.acceleration.z(), kGravity, 1e-5);
  EXPECT_NEAR(s.rate.z(), rate, 1e-9);
}

TEST(Motion, CarKeepsItsLimitsAndStops) {
  const CenterLine line(
      {}, {{200.0, 0.0, 0.0}, {40.0, 0.0, 0.02}, {60.0, 0.02, 0.02}, {40.0, 0.02, 0.0}, {200.0, 0.0, 0.0}});
  MotionConfig c;
  c.speed = 15.0;
  c.events = {{120.0, 3.0, 0.0, -1.0, -1.0}};
  const Route route({{line, 0.0, line.length(), 0.0}}, false);
  const Motion motion(c, route, 120.0, 1);
  double stood = 0.0, fastest_in_curve = 0.0, hardest = 0.0, strongest = 0.0;
  for (double t = 2.0; t < 80.0; t += 0.01) {
    const double d = motion.distance(t);
    if (std::abs(motion.speed(t)) < 1e-3 && d > 100.0 && d < 140.0) {
      stood += 0.01;
      EXPECT_NEAR(d, 120.0, 0.6);
    }
    if (d > 242.0 && d < 298.0) fastest_in_curve = std::max(fastest_in_curve, motion.speed(t));
    hardest = std::min(hardest, motion.acceleration(t));
    strongest = std::max(strongest, motion.acceleration(t));
  }
  EXPECT_GT(stood, 2.5);
  EXPECT_LT(fastest_in_curve, 1.02 * std::sqrt(c.lateral * 50.0));
  EXPECT_GT(hardest, -1.6 * c.braking);
  EXPECT_LT(strongest, 1.05 * c.acceleration);
  EXPECT_NEAR(motion.distance(119.0), line.length() - 0.5, 1.0);  // it ends at the end
}

TEST(Motion, DerivativesAgree) {
  const CenterLine line({}, {{500.0, 0.0, 0.0}});
  for (VehicleKind kind : {VehicleKind::car, VehicleKind::legged}) {
    MotionConfig c;
    c.kind = kind;
    c.speed = kind == VehicleKind::car ? 10.0 : 1.3;
    c.events = {{20.0, 0.0, 5.0, -1.0, -1.0}};  // with a reverse
    const Motion motion(c, Route({{line, 0.0, 500.0, 0.0}}, false), 60.0, 1);
    bool reversed = false;
    for (double t = 0.5; t < 50.0; t += 0.37) {
      const double h = 1e-4;
      EXPECT_NEAR((motion.distance(t + h) - motion.distance(t - h)) / (2 * h), motion.speed(t), 1e-6);
      EXPECT_NEAR((motion.speed(t + h) - motion.speed(t - h)) / (2 * h), motion.acceleration(t), 1e-4);
      EXPECT_LT((motion.pose(t + h).translation() - motion.pose(t - h).translation()).norm(),
                2 * h * (std::abs(motion.speed(t)) * 1.3 + 1.0));
      reversed |= motion.speed(t) < -0.1;
    }
    EXPECT_TRUE(reversed);
  }
}

TEST(Gnss, GeodeticRoundNumbers) {
  double lat, lon, alt;
  to_geodetic({0.0, 0.0, 0.0}, {0.0, 0.0, 10.0}, lat, lon, alt);
  EXPECT_NEAR(lat, 0.0, 1e-12);
  EXPECT_NEAR(alt, 10.0, 1e-6);
  // One degree of longitude on the equator is 111319.49 m of arc; along the tangent plane slightly more.
  to_geodetic({0.0, 0.0, 0.0}, {1000.0, 0.0, 0.0}, lat, lon, alt);
  EXPECT_NEAR(lon, 1000.0 / 111319.49, 1e-7);
  EXPECT_NEAR(alt, 1000.0 * 1000.0 / (2.0 * 6378137.0), 1e-3);
  // One degree of latitude at the equator: 110574.4 m.
  to_geodetic({0.0, 0.0, 0.0}, {0.0, 1000.0, 0.0}, lat, lon, alt);
  EXPECT_NEAR(lat, 1000.0 / 110574.4, 1e-7);
}

TEST(Gnss, FixedInTheOpenNothingInside) {
  const GnssConfig c;
  Gnss gnss(c, {}, 4);
  double square = 0.0;
  int n = 0;
  std::uint64_t k = 0;
  double t = 0.0;
  for (; t < 200.0; t += 0.1) {
    const GnssSample s = gnss.sample({1.0, 2.0, 3.0}, -500.0, t, k++);
    ASSERT_EQ(s.fix, GnssFix::rtk_fixed);
    square += (s.enu - Eigen::Vector3d(1.0, 2.0, 3.0)).head<2>().squaredNorm() / 2.0;
    ++n;
  }
  EXPECT_NEAR(std::sqrt(square / n), c.sigma_fixed, 0.1 * c.sigma_fixed);
  for (; t < 260.0; t += 0.1) {
    const GnssSample s = gnss.sample({}, 100.0, t, k++);
    EXPECT_EQ(s.fix, GnssFix::none);
    EXPECT_TRUE(std::isnan(s.latitude));
  }
  std::set<GnssFix> after;  // the way back to a fixed solution
  for (; t < 290.0; t += 0.1) after.insert(gnss.sample({}, -100.0, t, k++).fix);
  EXPECT_EQ(after.size(), 4U);
}

}  // namespace
}  // namespace adit::tunnel_simulator
