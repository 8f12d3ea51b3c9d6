#include "components/tunnel_simulator/lidar.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "components/tunnel_simulator/test_worlds.hpp"

namespace adit::tunnel_simulator {
namespace {

constexpr double kWidth = 9.0;
constexpr double kHeight = 6.0;
// Far from the origin and askew, where floats alone are good to a quarter of a millimetre.
const LineStart kFar{2500.0, -1800.0, 300.0, 0.7};

LidarConfig exact_lidar() {
  LidarConfig c;
  c.beams = *beam_table("os2_real", 256);
  c.min_range = 0.0;
  c.noise = false;
  c.edges = false;
  return c;
}

// Range from a point (tube coordinates: s, l, h) along a direction to the inside of the box tube with end walls.
double box_range(const Eigen::Vector3d& p, const Eigen::Vector3d& d, double length) {
  const Eigen::Vector3d low(0.0, -kWidth / 2.0, 0.0);
  const Eigen::Vector3d high(length, kWidth / 2.0, kHeight);
  double range = 1e9;
  for (int i = 0; i < 3; ++i) {
    if (d[i] > 0.0) range = std::min(range, (high[i] - p[i]) / d[i]);
    if (d[i] < 0.0) range = std::min(range, (low[i] - p[i]) / d[i]);
  }
  return range;
}

Pose tube_pose(const VolumeDescription& tube, double s, double l, double h, double yaw_angle) {
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::AngleAxisd(tube.line.at(s).heading + yaw_angle, Eigen::Vector3d::UnitZ()).toRotationMatrix() *
                  Eigen::AngleAxisd(0.03, Eigen::Vector3d(1, 1, 0).normalized()).toRotationMatrix();
  pose.translation() = tube.line.point(s, l, h);
  return pose;
}

TEST(Lidar, RangeToPlanesIsExact) {
  const World world(plain_tube(box_profile(kWidth, kHeight, Material::concrete, Material::concrete), kFar));
  const VolumeDescription& tube = world.description().volumes[0];
  RayCaster caster(world, {});
  const Pose pose = tube_pose(tube, 40.0, 1.2, 2.0, 0.2);
  caster.look_from(pose.translation());
  Lidar lidar(exact_lidar(), 1);
  LidarScan scan;
  lidar.sweep(
      caster, {}, [&](double) { return pose; }, 0.0, 0, 1, scan);
  ASSERT_EQ(scan.returns(), scan.ranges.size());
  const Eigen::Matrix3d to_tube = Eigen::AngleAxisd(-kFar.heading, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Vector3d start(kFar.x, kFar.y, kFar.z);
  double worst = 0.0;
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    // The scan's own floats have a resolution of 4 um at 50 m: compare the near ones, to a micrometre.
    if (scan.ranges[i] > 8.0F) continue;
    const std::size_t ring = i / static_cast<std::size_t>(scan.columns);
    const int column = static_cast<int>(i % static_cast<std::size_t>(scan.columns));
    const double azimuth =
        std::numbers::pi - 2.0 * std::numbers::pi * column / scan.columns + lidar.config().beams.azimuth_offset[ring];
    const double elevation = lidar.config().beams.elevation[ring];
    const Eigen::Vector3d flat(std::cos(azimuth), std::sin(azimuth), 0.0);
    const Eigen::Vector3d beam = std::cos(elevation) * flat + Eigen::Vector3d(0.0, 0.0, std::sin(elevation));
    const Eigen::Vector3d from = to_tube * (pose * Eigen::Vector3d(lidar.config().beams.origin_radius * flat) - start);
    const double range = box_range(from, to_tube * (pose.linear() * beam), 100.0);
    worst = std::max(worst, std::abs(range - static_cast<double>(scan.ranges[i])));
  }
  EXPECT_LT(worst, 1e-6);
}

TEST(RayCaster, RangeToCylinderIsExact) {
  // Chords of 1.2 mm: the polygon is within 0.07 um of the circle.
  const double diameter = 5.6, floor_width = 1.0;
  const World world(
      plain_tube(round_profile(diameter, floor_width, Material::concrete, Material::concrete, 0.0012), kFar, 20.0));
  const VolumeDescription& tube = world.description().volumes[0];
  RayCaster caster(world, {});
  const double axis_height = std::sqrt(diameter * diameter / 4.0 - floor_width * floor_width / 4.0);
  const Eigen::Vector2d eye(0.7, 1.9);  // (l, h)
  const Eigen::Vector3d from = tube.line.point(10.0, eye.x(), eye.y());
  caster.look_from(from);
  double worst = 0.0;
  int compared = 0;
  for (int k = 0; k < 40; ++k) {
    RayPacket packet;
    packet.time.fill(0.0F);
    std::array<Eigen::Vector3d, kPacket> direction;
    std::array<double, kPacket> expected;
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      const double angle = 0.01 * k + 0.2 * static_cast<double>(lane);
      const double slope = 0.02 * k;
      const Eigen::Vector2d flat(std::cos(angle), std::sin(angle));
      const Eigen::Vector3d local = Eigen::Vector3d(slope, flat.x(), flat.y()).normalized();
      direction[lane] = Eigen::AngleAxisd(kFar.heading, Eigen::Vector3d::UnitZ()) * local;
      const Eigen::Vector2d d = local.tail<2>();
      const Eigen::Vector2d o = eye - Eigen::Vector2d(0.0, axis_height);
      const double a = d.squaredNorm(), b = o.dot(d), c = o.squaredNorm() - diameter * diameter / 4.0;
      expected[lane] = (-b + std::sqrt(b * b - a * c)) / a;
      const Eigen::Vector3d local_from = from - caster.origin();
      for (auto [array, value] : {std::pair{&packet.ox, local_from.x()},
                                  {&packet.oy, local_from.y()},
                                  {&packet.oz, local_from.z()},
                                  {&packet.dx, direction[lane].x()},
                                  {&packet.dy, direction[lane].y()},
                                  {&packet.dz, direction[lane].z()}}) {
        (*array)[lane] = static_cast<float>(value);
      }
      packet.far[lane] = 100.0F;
    }
    caster.cast(packet);
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      ASSERT_TRUE(packet.hit(lane));
      const Eigen::Vector3d local = Eigen::AngleAxisd(-kFar.heading, Eigen::Vector3d::UnitZ()) * direction[lane];
      const double height = eye.y() + expected[lane] * local.z();
      if (height < 0.1) continue;  // the flat invert
      worst = std::max(worst, std::abs(caster.exact_range(packet, lane, from, direction[lane]) - expected[lane]));
      ++compared;
    }
  }
  EXPECT_GT(compared, 300);
  EXPECT_LT(worst, 1e-6);
}

TEST(Lidar, MovingScanUndistortsToTheWalls) {
  const World world(plain_tube(box_profile(kWidth, kHeight, Material::concrete, Material::concrete), kFar));
  const VolumeDescription& tube = world.description().volumes[0];
  RayCaster caster(world, {});
  const auto pose = [&](double t) { return tube_pose(tube, 30.0 + 27.8 * t, 0.8 - 2.0 * t, 2.0, 0.1 + 0.5 * t); };
  caster.look_from(pose(0.05).translation());
  for (const char* model : {"os2_paper", "vlp16"}) {
    LidarConfig config = exact_lidar();
    config.beams = *beam_table(model, 512);
    Lidar lidar(config, 1);
    LidarScan scan;
    lidar.sweep(caster, {}, pose, 0.0, 0, 1, scan);
    double worst = 0.0;
    double distortion = 0.0;
    for (std::size_t i = 0; i < scan.points.size(); ++i) {
      if (scan.ranges[i] <= 0.0F) continue;
      const auto to_wall = [&](const Eigen::Vector3d& world_point) {
        const LineCoordinates c = tube.line.project(world_point);
        return std::min({std::abs(kWidth / 2.0 - std::abs(c.l)), std::abs(c.h), std::abs(kHeight - c.h), std::abs(c.s),
                         std::abs(100.0 - c.s)});
      };
      const Eigen::Vector3d p = scan.points[i].cast<double>();
      worst = std::max(worst, to_wall(pose(1e-9 * scan.time_ns[i]) * p));
      distortion = std::max(distortion, to_wall(pose(0.0) * p));
    }
    EXPECT_LT(worst, 1e-3) << model;
    EXPECT_GT(distortion, 0.1) << model;  // there was something to undo
  }
}

class LidarNoise : public ::testing::Test {
 protected:
  const World world_{plain_tube(box_profile(kWidth, kHeight, Material::concrete, Material::concrete), {})};
  RayCaster caster_{world_, {}};
  Pose pose_ = tube_pose(world_.description().volumes[0], 50.0, 0.0, 2.0, 0.0);
  LidarScan scan_;

  LidarConfig config() {
    LidarConfig c;
    c.beams = *beam_table("os2_paper", 512);
    c.edges = false;
    c.quantum = 0.0;
    c.false_alarm = 0.0;
    return c;
  }
  LidarScan sweep(const LidarConfig& c, const Atmosphere& atmosphere = {}, std::uint64_t frame = 0) {
    caster_.look_from(pose_.translation());
    Lidar lidar(c, 7);
    LidarScan scan;
    lidar.sweep(
        caster_, atmosphere, [&](double) { return pose_; }, 0.0, frame, 1, scan);
    return scan;
  }
};

TEST_F(LidarNoise, RangeSigmaIsAsConfigured) {
  LidarConfig c = config();
  c.range_sigma_weak = 0.0;
  c.range_sigma = 0.031;
  const LidarScan noisy = sweep(c);
  c.noise = false;
  const LidarScan truth = sweep(c);
  double sum = 0.0, square = 0.0;
  int n = 0;
  for (std::size_t i = 0; i < truth.ranges.size(); ++i) {
    if (noisy.ranges[i] <= 0.0F) continue;
    const double e = static_cast<double>(noisy.ranges[i]) - static_cast<double>(truth.ranges[i]);
    sum += e;
    square += e * e;
    ++n;
  }
  ASSERT_GT(n, 50000);
  EXPECT_NEAR(std::sqrt(square / n), 0.031, 0.05 * 0.031);
  EXPECT_NEAR(sum / n, 0.0, 5.0 * 0.031 / std::sqrt(n));
}

TEST_F(LidarNoise, RangeSigmaGrowsAndReturnsVanishWithTheSignal) {
  LidarConfig c = config();
  c.range_sigma = 0.0;
  c.range_sigma_weak = 0.08;
  c.detection_range = 12.0;  // so that the walls span strong and weak
  const LidarScan noisy = sweep(c);
  c.noise = false;
  const LidarScan truth = sweep(c);
  double square = 0.0;
  int n = 0, at_limit = 0, seen = 0;
  for (std::size_t i = 0; i < truth.ranges.size(); ++i) {
    const double strength = static_cast<double>(truth.signal[i]) / 100.0;
    if (strength > 0.9 && strength < 1.1) {
      ++at_limit;
      seen += noisy.ranges[i] > 0.0F ? 1 : 0;
    }
    if (noisy.ranges[i] <= 0.0F || strength < 0.5) continue;
    const double e =
        (static_cast<double>(noisy.ranges[i]) - static_cast<double>(truth.ranges[i])) * std::sqrt(strength);
    square += e * e;
    ++n;
  }
  ASSERT_GT(n, 10000);
  ASSERT_GT(at_limit, 500);
  EXPECT_NEAR(std::sqrt(square / n), 0.08, 0.05 * 0.08);
  EXPECT_NEAR(static_cast<double>(seen) / at_limit, 0.9, 0.05);
}

TEST_F(LidarNoise, FogAttenuatesByBeerLambert) {
  LidarConfig c = config();
  c.noise = false;
  const LidarScan clear = sweep(c);
  Atmosphere fog;
  SmokeBox box;
  box.pose.translation() = Eigen::Vector3d(50.0, 0.0, 3.0);
  box.half_size = {200.0, 50.0, 50.0};
  box.extinction = extinction(Obscurant::fog, 20.0);
  fog.add(box);
  EXPECT_NEAR(box.extinction.lidar, 3.912 / 20.0, 1e-12);
  const LidarScan hazy = sweep(c, fog);
  int n = 0;
  for (std::size_t i = 0; i < clear.ranges.size(); ++i) {
    const double range = clear.ranges[i];
    const double expected = clear.signal[i] * std::exp(-2.0 * 3.912 / 20.0 * range);
    if (expected < 200.0) continue;
    EXPECT_NEAR(hazy.signal[i], expected, 0.005 * expected + 1.0);
    ++n;
  }
  EXPECT_GT(n, 1000);
}

TEST_F(LidarNoise, DenseSmokeAnswersNearTheSensor) {
  Atmosphere smoke;
  SmokeBox box;
  box.pose.translation() = Eigen::Vector3d(50.0, 0.0, 3.0);
  box.half_size = {200.0, 50.0, 50.0};
  box.extinction = extinction(Obscurant::fog, 3.0);
  smoke.add(box);
  const LidarScan scan = sweep(config(), smoke);
  int near = 0, beyond = 0;
  for (float r : scan.ranges) {
    near += r > 0.0F && r < 3.0F ? 1 : 0;
    beyond += r > 15.0F ? 1 : 0;
  }
  EXPECT_GT(near, 3000);
  EXPECT_EQ(beyond, 0);
}

TEST_F(LidarNoise, FalseAlarmsAndMinimumRange) {
  LidarConfig c = config();
  c.max_range = 3.0;  // nothing is that near but the floor
  c.min_range = 2.5;
  c.false_alarm = 0.0;
  for (float r : sweep(c).ranges) EXPECT_TRUE(r == 0.0F || (r >= 2.5F && r <= 3.0F));
}

TEST(BeamTable, KnownModels) {
  for (const char* name : {"os2_paper", "os2_real", "os1", "os0"}) EXPECT_EQ(beam_table(name)->elevation.size(), 128U);
  EXPECT_EQ(beam_table("vlp16")->elevation.size(), 16U);
  const double degree = std::numbers::pi / 180.0;
  EXPECT_NEAR(beam_table("os2_paper")->elevation.front() - beam_table("os2_paper")->elevation.back(), 45.0 * degree,
              1e-12);
  EXPECT_NEAR(beam_table("os2_real")->elevation.front() - beam_table("os2_real")->elevation.back(), 21.85 * degree,
              1e-12);
  EXPECT_FALSE(beam_table("os9"));
}

}  // namespace
}  // namespace adit::tunnel_simulator
