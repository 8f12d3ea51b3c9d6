#include "components/thermal_odometry/front_end.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "components/thermal_odometry/test_scene.hpp"

namespace adit::thermal_odometry {
namespace {

struct Picture {
  int width = 320;
  int height = 256;
  std::vector<std::uint16_t> pixels = std::vector<std::uint16_t>(320 * 256, 6000);
  Frame at(std::int64_t stamp_ns) const { return {pixels.data(), width, height, 0, stamp_ns, FfcState::unknown}; }
  void noise(std::uint32_t seed, double sigma = 2.5) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(6000.0, sigma);
    for (auto& pixel : pixels) pixel = static_cast<std::uint16_t>(std::lround(normal(random)));
  }
};

CameraModel camera() {
  return TestScene().camera;
}

TEST(FrameGate, NamesEveryBadFrame) {
  FrameGate gate(camera(), {});
  Picture picture;
  picture.noise(1);
  EXPECT_EQ(gate.check({}, 2.5F), Verdict::wrong_size);
  Frame small = picture.at(1);
  small.width = 160;
  EXPECT_EQ(gate.check(small, 2.5F), Verdict::wrong_size);
  EXPECT_EQ(gate.check(picture.at(10), 2.5F), Verdict::good);
  EXPECT_EQ(gate.check(picture.at(20), 2.5F), Verdict::frozen);
  picture.noise(2);
  EXPECT_EQ(gate.check(picture.at(20), 2.5F), Verdict::bad_stamp);
  EXPECT_EQ(gate.check(picture.at(5), 2.5F), Verdict::bad_stamp);
  EXPECT_EQ(gate.check(picture.at(30), 2.5F), Verdict::good);
  Frame shutter = picture.at(40);
  shutter.ffc = FfcState::in_progress;
  EXPECT_EQ(gate.check(shutter, 2.5F), Verdict::ffc);
  Picture flat;
  EXPECT_EQ(gate.check(flat.at(50), 2.5F), Verdict::uniform);
  for (auto& pixel : flat.pixels) pixel = 65535;
  EXPECT_EQ(gate.check(flat.at(60), 2.5F), Verdict::saturated);
  for (std::size_t i = 0; i < flat.pixels.size(); ++i)
    flat.pixels[i] = static_cast<std::uint16_t>(i * 2654435761U >> 24U & 0xFFU);
  EXPECT_EQ(gate.check(flat.at(70), 2.5F), Verdict::eight_bit);
  for (auto& pixel : flat.pixels) pixel = static_cast<std::uint16_t>(pixel << 8U);
  EXPECT_EQ(gate.check(flat.at(80), 2.5F), Verdict::eight_bit);
  picture.noise(3);
  EXPECT_EQ(gate.check(picture.at(90), 2.5F), Verdict::good);
}

TEST(FrameGate, AClockSetBackIsBelievedAfterFiveFramesThatAgree) {
  FrameGate gate(camera(), {});
  Picture picture;
  std::uint32_t seed = 1;
  const auto check = [&](std::int64_t stamp) {
    picture.noise(++seed);
    return gate.check(picture.at(stamp), 2.5F);
  };
  EXPECT_EQ(check(2'000'000'000), Verdict::good);
  for (int i = 1; i < 5; ++i) EXPECT_EQ(check(100 + i), Verdict::bad_stamp);
  EXPECT_EQ(check(105), Verdict::good);
  EXPECT_TRUE(gate.clock_set_back());
  EXPECT_EQ(check(106), Verdict::good);
  EXPECT_FALSE(gate.clock_set_back());
  // Late frames among punctual ones, frames in reverse, and any number that one frame has overtaken, are no clock.
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(check(200 + 10 * i), Verdict::good);
    EXPECT_EQ(check(110 + i), Verdict::bad_stamp);
  }
  for (int i = 0; i < 20; ++i) EXPECT_EQ(check(300 - i), Verdict::bad_stamp);
  EXPECT_EQ(check(900'000'000), Verdict::good);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(check(500'000'000 + i), Verdict::bad_stamp);
}

TEST(FrontEnd, NoiseIsFoundUnderTexture) {
  TestScene scene;
  std::vector<float> scratch;
  EXPECT_NEAR(estimate_noise(scene.render(Pose::Identity(), 0), scratch), 2.5F, 0.6F);
  Picture pure;
  pure.noise(4, 4.0);
  EXPECT_NEAR(estimate_noise(pure.at(0), scratch), 4.0F, 0.3F);
}

TEST(FrontEnd, OutputIsInNoiseUnitsAndKeepsSixteenBits) {
  Picture picture;
  picture.noise(5);
  for (auto& pixel : picture.pixels) pixel = static_cast<std::uint16_t>(pixel + 20000);
  picture.pixels[100 * 320 + 50] = 60000;
  FrontEnd front_end(camera(), {.noise_counts = 2.5F, .destripe = false, .bilateral = false});
  front_end.calibrate(picture.at(0));
  Pyramid pyramid;
  pyramid.allocate(320, 256);
  front_end.process(picture.at(0), pyramid);
  double sum = 0.0;
  double squares = 0.0;
  for (int y = 10; y < 90; ++y) {
    for (int x = 10; x < 310; ++x) {
      sum += pyramid.level(0).row(y)[x];
      squares += std::pow(pyramid.level(0).row(y)[x], 2);
    }
  }
  EXPECT_NEAR(sum / 24000, 0.0, 0.3);
  EXPECT_NEAR(std::sqrt(squares / 24000), 1.0, 0.05);
  EXPECT_NEAR(pyramid.level(0).row(100)[50], (60000 - 26000) / 2.5, 1.0);
}

TEST(FrontEnd, BilateralHalvesNoiseAndKeepsEdges) {
  Picture picture;
  picture.noise(6);
  for (int y = 0; y < 256; ++y) {
    for (int x = 160; x < 320; ++x) picture.pixels[static_cast<std::size_t>(y * 320 + x)] += 100;  // 40 units
  }
  FrontEnd front_end(camera(), {.noise_counts = 2.5F, .destripe = false, .bilateral = true});
  front_end.calibrate(picture.at(0));
  Pyramid pyramid;
  pyramid.allocate(320, 256);
  front_end.process(picture.at(0), pyramid);
  double mean = 0.0;
  double squares = 0.0;
  double edge = 0.0;
  for (int y = 10; y < 246; ++y) {
    for (int x = 10; x < 150; ++x) {
      mean += pyramid.level(0).row(y)[x] / (236 * 140);
      squares += std::pow(pyramid.level(0).row(y)[x], 2) / (236 * 140);
    }
    edge += (pyramid.level(0).row(y)[160] - pyramid.level(0).row(y)[159]) / 236.0;
  }
  EXPECT_LT(std::sqrt(squares - mean * mean), 0.5);
  EXPECT_NEAR(edge, 40.0, 1.0);
}

TEST(FrontEnd, DestripingRemovesColumnsAndNotTheScene) {
  TestScene scene;
  scene.noise = 2.5;
  std::mt19937 random(3);
  std::normal_distribution<float> stripe(0.0F, 1.5F);
  std::vector<float> stripes(320);
  for (float& value : stripes) value = stripe(random);
  scene.fixed_pattern.resize(320 * 256);
  for (std::size_t i = 0; i < scene.fixed_pattern.size(); ++i) scene.fixed_pattern[i] = stripes[i % 320];
  FrontEnd::Config config{.noise_counts = 2.5F, .destripe = true, .bilateral = false};
  FrontEnd on(scene.camera, config);
  config.destripe = false;
  FrontEnd off(scene.camera, config);
  Pyramid cleaned;
  Pyramid striped;
  cleaned.allocate(320, 256);
  striped.allocate(320, 256);
  for (int i = 0; i < 80; ++i) {
    const Frame frame = scene.render(TestScene::drive(i * 0.04, 3.0), i);
    if (i == 0) {
      on.calibrate(frame);
      off.calibrate(frame);
    }
    on.process(frame, cleaned);
    if (i == 79) off.process(frame, striped);
  }
  double before = 0.0;
  double after = 0.0;
  double mean_before = 0.0;
  double mean_after = 0.0;
  for (int x = 20; x < 300; ++x) {
    double removed = 0.0;
    for (int y = 0; y < 256; ++y) removed += (striped.level(0).row(y)[x] - cleaned.level(0).row(y)[x]) / 256.0;
    const double truth = stripes[static_cast<std::size_t>(x)] / 2.5;
    before += truth * truth;
    after += std::pow(truth - removed, 2);
    mean_before += truth;
    mean_after += truth - removed;
  }
  before -= mean_before * mean_before / 280;
  after -= mean_after * mean_after / 280;
  EXPECT_LT(after, 0.35 * before);
}

TEST(Pyramid, ReducesByMeansAndSamplesLikeTheDefinition) {
  Pyramid pyramid;
  pyramid.allocate(64, 48);
  ASSERT_EQ(pyramid.levels(), 1);
  pyramid.allocate(160, 120);
  ASSERT_EQ(pyramid.levels(), 3);
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(-50.0F, 50.0F);
  for (float& pixel : pyramid.base().pixels) pixel = uniform(random);
  pyramid.reduce();
  const Image& fine = pyramid.level(0);
  EXPECT_NEAR(pyramid.level(1).row(7)[9],
              0.25F * (fine.row(14)[18] + fine.row(14)[19] + fine.row(15)[18] + fine.row(15)[19]), 1e-4F);
  for (int i = 0; i < 500; ++i) {
    const float x = 2.0F + 150.0F * (uniform(random) + 50.0F) / 100.0F;
    const float y = 2.0F + 110.0F * (uniform(random) + 50.0F) / 100.0F;
    ASSERT_TRUE(samplable(fine, x, y));
    const int ix = static_cast<int>(x);
    const int iy = static_cast<int>(y);
    const float wx = x - static_cast<float>(ix);
    const float wy = y - static_cast<float>(iy);
    float value = 0.0F;
    float gx = 0.0F;
    float gy = 0.0F;
    for (int k = 0; k < 4; ++k) {
      const int px = ix + k % 2;
      const int py = iy + k / 2;
      const float w = (k % 2 ? wx : 1 - wx) * (k / 2 ? wy : 1 - wy);
      value += w * fine.row(py)[px];
      gx += w * 0.5F * (fine.row(py)[px + 1] - fine.row(py)[px - 1]);
      gy += w * 0.5F * (fine.row(py + 1)[px] - fine.row(py - 1)[px]);
    }
    const Sample s = sample(fine, x, y);
    EXPECT_NEAR(s.value, value, 1e-3F);
    EXPECT_NEAR(s.gx, gx, 1e-3F);
    EXPECT_NEAR(s.gy, gy, 1e-3F);
    EXPECT_NEAR(sample_value(fine, x, y), value, 1e-3F);
  }
}

}  // namespace
}  // namespace adit::thermal_odometry
