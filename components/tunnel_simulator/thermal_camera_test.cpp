#include "components/tunnel_simulator/thermal_camera.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "components/tunnel_simulator/test_worlds.hpp"

namespace adit::tunnel_simulator {
namespace {

TEST(CameraModel, DistortionInvertsWithinAHundredthPixel) {
  CameraModel m = CameraModel::from_hfov(640, 512, 75.0 * 3.14159265358979 / 180.0);
  EXPECT_NEAR(m.fx, 417.03, 0.01);
  m.k1 = -0.25;
  m.k2 = 0.06;
  m.p1 = 1e-3;
  m.p2 = -8e-4;
  m.k3 = -0.005;
  double worst = 0.0;
  for (double y = 0.0; y < 512.0; y += 7.3) {
    for (double x = 0.0; x < 640.0; x += 7.3) {
      worst = std::max(worst, (m.project(3.7 * m.ray({x, y})) - Eigen::Vector2d(x, y)).norm());
    }
  }
  EXPECT_LT(worst, 0.01);
}

TEST(CameraModel, UninvertibleModelIsToldNotGuessed) {
  CameraModel m;
  m.k1 = -0.9;  // folds back within the image
  EXPECT_FALSE(m.undistort({1.2, 0.9}).has_value());
  EXPECT_TRUE(m.ray({639.0, 511.0}).allFinite());
}

TEST(BandRadiance, MatchesPlanckAtTabulatedTemperatures) {
  // Fraction of sigma T^4 / pi within 8-14 um from the black-body fraction table (Incropera, table 12.1):
  // F(0 - 8 um . 300 K) = 0.1402, F(0 - 14 um . 300 K) = 0.5160 (interpolated).
  const BandRadiance band;
  const double total = 5.670374e-8 * std::pow(300.0, 4) / 3.14159265358979;
  EXPECT_NEAR(band.at(26.85F) / total, 0.5160 - 0.1402, 0.003);
  EXPECT_GT(band.slope_at(10.0F), 0.0F);
}

class Camera : public ::testing::Test {
 protected:
  World world_{plain_tube(box_profile(9.0, 6.0, Material::concrete, Material::concrete), {})};
  RayCaster caster_{world_, {}};
  Pose pose_ = Pose::Identity();

  void SetUp() override {
    pose_.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    pose_.translation() = Eigen::Vector3d(50.0, 0.0, 2.0);
    caster_.look_from(pose_.translation());
  }
  ThermalConfig quiet() {
    ThermalConfig c;
    c.noise = false;
    c.blur = 0.0;
    c.time_constant = 0.0;
    c.row_time = 0.0;
    c.ffc_first = -1.0;
    return c;
  }
  void capture(ThermalCamera& camera, double time, std::uint64_t frame, ThermalImage& image, const Atmosphere& a = {}) {
    camera.capture(
        caster_, a, [this](double) { return pose_; }, time, frame, 1, image);
  }
};

TEST_F(Camera, TemporalNoiseIsTheNetd) {
  ThermalConfig c = quiet();
  c.noise = true;
  c.netd = 0.055;
  c.column_noise = 0.0;
  c.drift = 0.0;
  c.counts_per_kelvin = 400.0;  // so that rounding to counts does not add to it
  ThermalCamera camera(c, 3);
  ThermalImage a, b;
  capture(camera, 0.0, 0, a);
  capture(camera, 0.0, 1, b);
  double square = 0.0;
  for (std::size_t i = 0; i < a.counts.size(); ++i) {
    const double d = (static_cast<double>(a.counts[i]) - static_cast<double>(b.counts[i])) / 400.0;
    square += d * d;
  }
  const double sigma = std::sqrt(square / static_cast<double>(a.counts.size()) / 2.0);
  EXPECT_NEAR(sigma, 0.055, 0.05 * 0.055);
}

TEST_F(Camera, PatternGrowsAndTheShutterRenewsIt) {
  ThermalConfig c = quiet();
  c.noise = true;
  c.netd = c.column_noise = c.drift = 0.0;
  c.pattern = 0.02;
  c.pattern_growth = 0.05;
  c.counts_per_kelvin = 400.0;
  c.ffc_first = 10.0;
  c.ffc_interval = 120.0;
  ThermalCamera camera(c, 3);
  ThermalImage early, late, after;
  const auto rms = [&](const ThermalImage& image) {
    double sum = 0.0, square = 0.0;
    for (std::uint16_t v : image.counts) {
      sum += v;
      square += static_cast<double>(v) * v;
    }
    const auto n = static_cast<double>(image.counts.size());
    return std::sqrt(square / n - sum * sum / n / n) / 400.0;
  };
  capture(camera, 11.0, 1, early);
  capture(camera, 10.0 + 119.0, 2, late);
  EXPECT_NEAR(rms(early), 0.02 + 0.05 * std::sqrt(1.0 / 60.0), 0.25 * rms(early));
  EXPECT_GT(rms(late), 2.0 * rms(early));
  capture(camera, 10.0 + 120.0 + 0.5, 3, after);
  EXPECT_LT(rms(after), 0.6 * rms(late));
  double product = 0.0, mean_a = 0.0, mean_b = 0.0;  // the new pattern has nothing to do with the old
  const auto n = static_cast<double>(late.counts.size());
  for (std::size_t i = 0; i < late.counts.size(); ++i) {
    mean_a += late.counts[i] / n;
    mean_b += after.counts[i] / n;
  }
  for (std::size_t i = 0; i < late.counts.size(); ++i)
    product += (late.counts[i] - mean_a) * (after.counts[i] - mean_b) / n;
  EXPECT_LT(std::abs(product) / (rms(late) * rms(after) * 160000.0), 0.35);
}

TEST_F(Camera, ClosedShutterRepeatsTheFrame) {
  ThermalConfig c;
  c.ffc_first = 1.0;
  c.ffc_duration = 0.4;
  ThermalCamera camera(c, 3);
  ThermalImage image;
  capture(camera, 0.95, 0, image);
  EXPECT_EQ(image.ffc, FfcState::idle);
  const std::vector<std::uint16_t> before = image.counts;
  capture(camera, 1.0, 1, image);
  EXPECT_TRUE(image.frozen);
  EXPECT_EQ(image.ffc, FfcState::in_progress);
  EXPECT_EQ(image.counts, before);
  capture(camera, 1.45, 2, image);
  EXPECT_FALSE(image.frozen);
  EXPECT_EQ(image.ffc, FfcState::complete);
  EXPECT_NE(image.counts, before);
}

TEST_F(Camera, IsothermalTunnelIsUniform) {
  ThermalConfig c = quiet();
  ThermalCamera camera(c, 3);
  ThermalImage image;
  capture(camera, 0.0, 0, image);
  for (std::uint16_t v : image.counts) ASSERT_EQ(v, 6000U);  // wall and air at one temperature: emissivity is no matter
}

TEST_F(Camera, SmokeVeilsByBeerLambert) {
  WorldDescription warm = world_.description();
  warm.volumes[0].cap_end = false;
  Atmosphere smoke;
  SmokeBox box;
  box.pose.translation() = Eigen::Vector3d(50.0, 0.0, 3.0);
  box.half_size = {500.0, 50.0, 50.0};
  box.extinction = extinction(Obscurant::soot, 5.0);
  smoke.add(box);
  warm.temperatures.air = 20.0;  // warmer than the wall at 10
  const World world(warm);
  RayCaster caster(world, {});
  caster.look_from(pose_.translation());
  ThermalConfig c = quiet();
  c.counts_per_kelvin = 800.0;
  c.counts_at_wall = 4000.0;
  ThermalCamera camera(c, 3);
  ThermalImage clear, hazy;
  camera.capture(
      caster, {}, [this](double) { return pose_; }, 0.0, 0, 1, clear);
  camera.capture(
      caster, smoke, [this](double) { return pose_; }, 0.0, 1, 1, hazy);
  // Pixel (320, 500) looks at the floor: range h / (down component of its ray).
  const BandRadiance& band = camera.radiance();
  for (int y : {400, 450, 500}) {
    const Eigen::Vector3d ray = c.camera.ray({319.0, static_cast<double>(y)});
    const double range = 2.0 / ray.y();
    const double through = std::exp(-0.04 * 3.912 / 5.0 * range);
    const double scale = 800.0 / band.slope_at(10.0F);
    const double wall = (clear.counts[static_cast<std::size_t>(y * 640 + 319)] - 4000.0) / scale + band.at(10.0F);
    const double expected = 4000.0 + scale * (through * wall + (1.0 - through) * band.at(20.0F) - band.at(10.0F));
    EXPECT_NEAR(hazy.counts[static_cast<std::size_t>(y * 640 + 319)], expected, 2.0);
  }
}

TEST_F(Camera, RollingRowsSeeTheirOwnPose) {
  // A warm end wall seen while the camera yaws: each row is shifted by its own time.
  WorldDescription d = world_.description();
  d.volumes[0].profile = box_profile(9.0, 6.0, Material::concrete, Material::bare_metal);
  d.temperatures.air = 40.0;  // the metal floor reflects it: floor warm, walls not
  const World world(d);
  RayCaster caster(world, {});
  caster.look_from(pose_.translation());
  ThermalConfig c = quiet();
  c.edges = false;
  c.row_time = 32e-6;
  const double rate = 2.0;  // rad/s
  const auto yawing = [&](double t) {
    Pose p = pose_;
    p.linear() = Eigen::AngleAxisd(rate * t, Eigen::Vector3d::UnitZ()) * pose_.linear();
    return p;
  };
  ThermalCamera rolling(c, 3);
  ThermalImage image;
  rolling.capture(caster, {}, yawing, 0.0, 0, 1, image);
  c.row_time = 0.0;
  ThermalCamera global(c, 3);
  for (int y : {300, 380, 460}) {  // each row equals that row of a global-shutter frame taken at its time
    ThermalImage reference;
    global.capture(caster, {}, yawing, 32e-6 * y, 0, 1, reference);
    for (int x = 0; x < 640; ++x) {
      ASSERT_EQ(image.counts[static_cast<std::size_t>(y * 640 + x)],
                reference.counts[static_cast<std::size_t>(y * 640 + x)])
          << x << ' ' << y;
    }
  }
  EXPECT_EQ(image.stamp_ns, 8192000);
}

TEST_F(Camera, LagTrailsTheMotion) {
  // Exponential response: a step edge that moves v px/s is seen tau * v behind, on average.
  WorldDescription d = world_.description();
  d.volumes[0].profile = box_profile(9.0, 6.0, Material::concrete, Material::bare_metal);
  d.temperatures.air = 40.0;
  const World world(d);
  RayCaster caster(world, {});
  caster.look_from(pose_.translation());
  ThermalConfig c = quiet();
  c.edges = false;
  const double rate = 1.0;
  const auto pitching = [&](double t) {
    Pose p = pose_;
    p.linear() = pose_.linear() * Eigen::AngleAxisd(rate * (t - 1.0), Eigen::Vector3d::UnitX()).toRotationMatrix();
    return p;
  };
  const auto column_sum = [&](const ThermalImage& image) {  // rows of floor in the middle column
    double sum = 0.0;
    for (int y = 0; y < 512; ++y) sum += image.counts[static_cast<std::size_t>(y * 640 + 320)] - 6000.0;
    return sum;
  };
  ThermalCamera sharp(c, 3);
  ThermalImage now, before, lagged;
  sharp.capture(caster, {}, pitching, 1.0, 0, 1, now);
  sharp.capture(caster, {}, pitching, 0.990, 0, 1, before);
  c.time_constant = 0.010;
  ThermalCamera slow(c, 3);
  slow.capture(caster, {}, pitching, 1.0, 0, 1, lagged);
  const double step = column_sum(now) - column_sum(before);
  ASSERT_GT(std::abs(step), 1000.0);
  EXPECT_NEAR((column_sum(now) - column_sum(lagged)) / step, 1.0, 0.15);
}

}  // namespace
}  // namespace adit::tunnel_simulator
