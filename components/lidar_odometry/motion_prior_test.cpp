#include "components/lidar_odometry/motion_prior.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace adit::lidar_odometry {
namespace {

constexpr std::int64_t ms = 1'000'000;

// Along a circle with a constant twist; every tenth pose of a filter jumps by a correction.
MotionSample sample(std::int64_t stamp_ns, double jump = 0.0) {
  MotionSample s;
  s.stamp_ns = stamp_ns;
  s.twist << 5.0, 0.0, 0.0, 0.0, 0.0, 0.2;
  s.pose = se3_exp(1e-9 * static_cast<double>(stamp_ns) * s.twist);
  s.pose.translation().x() += jump;
  s.twist_covariance.diagonal() << 0.01, 1e6, 1e6, 1e6, 1e6, 1e-4;
  return s;
}

MotionPrior filled(const MotionPriorConfig& config, bool jumps = false) {
  MotionPrior motion(config);
  for (int k = 0; k <= 100; ++k) EXPECT_TRUE(motion.add(sample(k * 10 * ms, jumps && k >= 55 ? 0.5 : 0.0)));
  return motion;
}

Pose mounting() {
  Pose pose = Pose::Identity();
  pose.linear() = so3_exp({0.0, 0.1, 1.0});
  pose.translation() << 1.0, 0.2, 1.5;
  return pose;
}

TEST(MotionPrior, IsTheMotionOfTheSensorBetweenAnyTwoInstants) {
  for (const bool differences : {false, true}) {
    const MotionPrior motion = filled({.sensor = mounting(), .differences = differences});
    // Within the messages, between them, and 0.1 s beyond the last one.
    for (const auto& [from, to] : {std::pair{200 * ms, 300 * ms}, {203 * ms, 304 * ms}, {995 * ms, 1095 * ms}}) {
      const std::optional<Prior> prior = motion.between(from, to);
      ASSERT_TRUE(prior);
      const Pose expected = (sample(from).pose * mounting()).inverse() * (sample(to).pose * mounting());
      EXPECT_LT(se3_log(expected.inverse() * prior->pose).norm(), 1e-9);
      EXPECT_EQ(prior->kind, Prior::Kind::increment);
    }
  }
}

TEST(MotionPrior, VelocitiesDoNotJumpWithTheCorrectionsOfAFilter) {
  const auto error = [](bool differences) {
    const MotionPrior motion = filled({.differences = differences}, true);
    const Pose expected = sample(500 * ms).pose.inverse() * sample(600 * ms).pose;
    return (expected.inverse() * motion.between(500 * ms, 600 * ms)->pose).translation().norm();
  };
  EXPECT_LT(error(false), 1e-9);
  EXPECT_NEAR(error(true), 0.5, 1e-6);
}

TEST(MotionPrior, InformationIsThatOfTheMessagesOverTheInterval) {
  const Prior prior = *filled({}).between(500 * ms, 600 * ms);
  EXPECT_NEAR(1.0 / std::sqrt(prior.information(0, 0)), std::hypot(0.01, 0.003), 1e-6);  // 0.1 m/s over 0.1 s
  EXPECT_LT(prior.information(1, 1), 1e-3);                                              // not known
  EXPECT_NEAR(1.0 / std::sqrt(prior.information(5, 5)), std::hypot(0.001, 0.002), 1e-6);
  EXPECT_FALSE(prior.twist);  // roll and pitch are not known

  MotionPriorConfig config;
  config.velocity_sigma = 0.2;
  config.rate_sigma = 0.01;
  const Prior set = *filled(config).between(500 * ms, 600 * ms);
  EXPECT_NEAR(1.0 / std::sqrt(set.information(1, 1)), std::hypot(0.02, 0.003), 1e-6);
  ASSERT_TRUE(set.twist);
  EXPECT_LT((*set.twist - sample(0).twist).norm(), 1e-6);
  // A sensor that looks sideways: its y axis is what the message knows.
  Pose turned = Pose::Identity();
  turned.linear() = so3_exp({0.0, 0.0, -M_PI / 2.0});
  const Prior sideways = *filled({.sensor = turned}).between(500 * ms, 600 * ms);
  EXPECT_GT(sideways.information(1, 1), 1e3);
  EXPECT_LT(sideways.information(0, 0), 1e-3);
}

TEST(MotionPrior, SaysNothingWhereTheMessagesDoNotReach) {
  MotionPrior motion = filled({});
  EXPECT_FALSE(MotionPrior().between(0, 100 * ms));
  EXPECT_FALSE(motion.between(1100 * ms, 1200 * ms));  // 0.2 s after the last one
  EXPECT_FALSE(motion.between(-300 * ms, -200 * ms));
  EXPECT_FALSE(motion.between(500 * ms, 500 * ms));
  EXPECT_FALSE(motion.between(600 * ms, 500 * ms));
  ASSERT_TRUE(motion.add(sample(2000 * ms)));
  EXPECT_FALSE(motion.between(1050 * ms, 1150 * ms));  // a gap of 1 s
  EXPECT_TRUE(motion.between(800 * ms, 900 * ms));
  motion.clear();
  EXPECT_FALSE(motion.between(800 * ms, 900 * ms));
}

TEST(MotionPrior, RefusesWhatIsNoOdometryAndWhatCameBefore) {
  MotionPrior motion = filled({});
  EXPECT_FALSE(motion.add(sample(1000 * ms)));  // repeated
  EXPECT_FALSE(motion.add(sample(500 * ms)));   // late
  MotionSample bad = sample(1010 * ms);
  bad.pose.translation().x() = std::nan("");
  EXPECT_FALSE(motion.add(bad));
  bad = sample(1010 * ms);
  bad.twist[0] = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(motion.add(bad));
  bad = sample(1010 * ms);
  bad.pose.linear() *= 2.0;
  EXPECT_FALSE(motion.add(bad));
  // A covariance that is none is not believed; the motion is.
  bad = sample(1010 * ms);
  bad.twist_covariance(0, 0) = -1.0;
  EXPECT_TRUE(motion.add(bad));
  const Prior prior = *motion.between(900 * ms, 1000 * ms);
  EXPECT_NEAR(1.0 / std::sqrt(prior.information(0, 0)), 0.03, 1e-3);
}

// Longer than the buffer: the oldest go.
TEST(MotionPrior, KeepsTheLastSeconds) {
  MotionPrior motion;
  for (int k = 0; k < 2000; ++k) ASSERT_TRUE(motion.add(sample(k * 5 * ms)));
  EXPECT_TRUE(motion.between(9'800 * ms, 9'900 * ms));
  EXPECT_FALSE(motion.between(1'000 * ms, 1'100 * ms));
}

}  // namespace
}  // namespace adit::lidar_odometry
