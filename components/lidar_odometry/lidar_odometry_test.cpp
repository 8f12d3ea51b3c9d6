// The properties every mode keeps: bad input, stamps, priors, frames, threads.
#include "components/lidar_odometry/lidar_odometry.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "components/lidar_odometry/test_scene.hpp"

namespace adit::lidar_odometry {
namespace {

constexpr std::int64_t period_ns = 100'000'000;

Config config_of(Mode mode) {
  Config config;
  config.mode = mode;
  config.kiss.voxel_size = 0.3;
  return config;
}

// How far a mode may be off after two metres. Point-to-point registration lags in slow motion: the rings, which move
// with the sensor, are matched to themselves (W21 of the specification).
double tolerance(Mode mode) {
  return mode == Mode::kiss ? 0.3 : 0.12;
}

Vector6d gentle_twist() {
  Vector6d twist;
  twist << 1.0, 0.1, 0.0, 0.0, 0.0, 0.1;
  return twist;
}

// Pose at the end of sweep k: at rest for two sweeps, then speeding up to the gentle twist within a second.
struct Drive {
  std::vector<RecordedSweep> sweeps;
  std::vector<Pose> ends;
};
Drive drive(const Scene& scene, int count, double speed_factor = 1.0, ScannerModel model = {}) {
  Drive drive;
  Pose pose = Pose::Identity();
  for (int k = 0; k < count; ++k) {
    const double factor = speed_factor * std::clamp(0.1 * (k - 1), 0.0, 1.0);
    const Vector6d twist = factor * gentle_twist();
    if (k > 0) pose = pose * se3_exp(model.period * twist);
    drive.ends.push_back(pose);
    drive.sweeps.push_back(scan(scene, model, pose, twist, k * period_ns, static_cast<unsigned>(k + 1)));
  }
  return drive;
}

double distance(const Pose& a, const Pose& b) {
  return (a.translation() - b.translation()).norm();
}

bool sane(const Estimate& e) {
  return e.pose.matrix().allFinite() && e.covariance.allFinite() && e.information.allFinite() && e.twist.allFinite() &&
         (e.pose.linear() * e.pose.linear().transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-6;
}

class EachMode : public testing::TestWithParam<Mode> {};

TEST_P(EachMode, FollowsADriveThroughAHall) {
  const Drive truth = drive(hall(), 30);
  LidarOdometry odometry(config_of(GetParam()));
  for (std::size_t k = 0; k < truth.sweeps.size(); ++k) {
    const Estimate& e = odometry.process(truth.sweeps[k].cloud());
    ASSERT_TRUE(sane(e));
    EXPECT_EQ(e.status, k == 0 ? Status::initialising : Status::ok) << k << ' ' << to_string(e.status);
  }
  // Reference instants differ by half a sweep (5 cm here) between the modes.
  EXPECT_LT(distance(odometry.estimate().pose, truth.ends.back()), tolerance(GetParam()));
  EXPECT_EQ(odometry.estimate().total.clouds, 30u);
  EXPECT_EQ(odometry.estimate().total.registered, 29u);
}

TEST_P(EachMode, IsBitIdenticalForAnyThreadCountAndFromRunToRun) {
  const Drive truth = drive(hall(), 12);
  std::vector<Pose> first;
  for (int threads : {1, 2, 4, 1}) {
    Config config = config_of(GetParam());
    config.threads = threads;
    LidarOdometry odometry(config);
    for (std::size_t k = 0; k < truth.sweeps.size(); ++k) {
      const Pose pose = odometry.process(truth.sweeps[k].cloud()).pose;
      if (first.size() < truth.sweeps.size()) {
        first.push_back(pose);
      } else {
        ASSERT_EQ(pose.matrix(), first[k].matrix()) << threads << " threads, sweep " << k;
      }
    }
  }
}

TEST_P(EachMode, ResetIsANewBeginning) {
  const Drive truth = drive(hall(), 6);
  LidarOdometry odometry(config_of(GetParam()));
  std::vector<Pose> first;
  for (const RecordedSweep& sweep : truth.sweeps) first.push_back(odometry.process(sweep.cloud()).pose);
  odometry.reset();
  EXPECT_EQ(odometry.estimate().total.clouds, 0u);
  for (std::size_t k = 0; k < first.size(); ++k) {
    EXPECT_EQ(odometry.process(truth.sweeps[k].cloud()).pose.matrix(), first[k].matrix());
  }
}

TEST_P(EachMode, StartsWhereAnAbsolutePriorSays) {
  const Drive truth = drive(hall(), 15);
  Prior start;
  start.kind = Prior::Kind::absolute;
  start.pose.translation() = Eigen::Vector3d(1e4, -2e4, 150.0);
  start.pose.linear() = so3_exp({0.1, -0.2, 2.0});
  LidarOdometry here(config_of(GetParam()));
  LidarOdometry there(config_of(GetParam()));
  for (std::size_t k = 0; k < truth.sweeps.size(); ++k) {
    const Pose a = here.process(truth.sweeps[k].cloud()).pose;
    const Pose b = there.process(truth.sweeps[k].cloud(), k == 0 ? &start : nullptr).pose;
    EXPECT_LT(se3_log((start.pose * a).inverse() * b).norm(), 1e-7);
  }
}

TEST_P(EachMode, RefusesEmptyTinyAndBrokenCloudsAndGoesOn) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  const Drive truth = drive(hall(), 8);
  LidarOdometry odometry(config_of(GetParam()));
  RecordedSweep empty, one, nans, zeros;
  one.points = {{1.0f, 2.0f, 3.0f}};
  nans.points.assign(5000, Point3f(nan, nan, nan));
  zeros.points.assign(5000, Point3f::Zero());
  for (RecordedSweep* bad : {&empty, &one, &nans, &zeros}) {
    bad->stamp_ns = -1;
    const Estimate& e = odometry.process(bad->cloud());
    EXPECT_EQ(e.status, Status::too_few_points);
    EXPECT_TRUE(sane(e));
  }
  std::uint64_t refused = 4;
  for (std::size_t k = 0; k < truth.sweeps.size(); ++k) {
    const Estimate& good = odometry.process(truth.sweeps[k].cloud());
    EXPECT_EQ(good.status, k == 0 ? Status::initialising : Status::ok);
    const Pose before = good.pose;
    RecordedSweep broken = truth.sweeps[k];
    broken.width += 1;
    EXPECT_EQ(odometry.process(broken.cloud()).status, Status::bad_cloud);
    EXPECT_EQ(odometry.estimate().pose.matrix(), before.matrix());
    ++refused;
  }
  EXPECT_EQ(odometry.estimate().total.refused, refused);
  EXPECT_LT(distance(odometry.estimate().pose, truth.ends.back()), 0.1);
}

TEST_P(EachMode, SkipsSingleBadPointsAndCountsThem) {
  Drive truth = drive(hall(), 8);
  LidarOdometry odometry(config_of(GetParam()));
  for (RecordedSweep& sweep : truth.sweeps) {
    for (std::size_t i = 0; i < sweep.points.size(); i += 10) {
      sweep.points[i] = Point3f(i % 20 == 0 ? std::numeric_limits<float>::infinity() : 0.0f, 0.0f, 0.0f);
    }
    const Estimate& e = odometry.process(sweep.cloud());
    EXPECT_GE(e.scan.invalid, sweep.points.size() / 10);
    EXPECT_TRUE(sane(e));
  }
  EXPECT_LT(distance(odometry.estimate().pose, truth.ends.back()), 0.1);
}

TEST_P(EachMode, SurvivesAWallOnly) {
  RecordedSweep wall;
  for (int i = -50; i < 50; ++i) {
    for (int j = -50; j < 50; ++j)
      wall.points.emplace_back(5.0f, 0.1f * static_cast<float>(i), 0.1f * static_cast<float>(j));
  }
  LidarOdometry odometry(config_of(GetParam()));
  for (int k = 0; k < 5; ++k) {
    wall.stamp_ns = k * period_ns;
    ASSERT_TRUE(sane(odometry.process(wall.cloud())));
    EXPECT_LT(odometry.estimate().pose.translation().norm(), 0.05);
  }
}

TEST_P(EachMode, RefusesRepeatedAndReversedStamps) {
  const Drive truth = drive(hall(), 6);
  LidarOdometry odometry(config_of(GetParam()));
  for (const RecordedSweep& sweep : truth.sweeps) {
    odometry.process(sweep.cloud());
    const Pose before = odometry.estimate().pose;
    EXPECT_EQ(odometry.process(sweep.cloud()).status, Status::bad_stamp);
    EXPECT_EQ(odometry.estimate().pose.matrix(), before.matrix());
    EXPECT_TRUE(sane(odometry.estimate()));
  }
  EXPECT_LT(distance(odometry.estimate().pose, truth.ends.back()), 0.1);
}

// A transport that is not in order: four late clouds in a row are still late, however well they go on from each other.
TEST_P(EachMode, RefusesCloudsThatWereOvertaken) {
  const Drive truth = drive(hall(), 14);
  LidarOdometry odometry(config_of(GetParam()));
  std::vector<Status> statuses;
  for (const int k : {0, 1, 2, 3, 4, 5, 10, 6, 7, 8, 9, 11, 12, 13}) {
    statuses.push_back(odometry.process(truth.sweeps[static_cast<std::size_t>(k)].cloud()).status);
  }
  for (int i = 0; i < 14; ++i) {
    EXPECT_EQ(statuses[static_cast<std::size_t>(i)] == Status::bad_stamp, i >= 7 && i <= 10) << i;
  }
  EXPECT_LT(distance(odometry.estimate().pose, truth.ends.back()), tolerance(GetParam()));
}

TEST_P(EachMode, BelievesAClockThatWasSetBackAfterThreeSweeps) {
  Drive truth = drive(hall(), 12);
  LidarOdometry odometry(config_of(GetParam()));
  std::vector<Status> statuses;
  for (std::size_t k = 0; k < truth.sweeps.size(); ++k) {
    if (k >= 6) truth.sweeps[k].stamp_ns -= 3600 * 1'000'000'000LL;
    statuses.push_back(odometry.process(truth.sweeps[k].cloud()).status);
    ASSERT_TRUE(sane(odometry.estimate()));
  }
  EXPECT_EQ(statuses[6], Status::bad_stamp);
  EXPECT_EQ(statuses[7], Status::bad_stamp);
  EXPECT_EQ(statuses[8], Status::ok);
  EXPECT_EQ(statuses[11], Status::ok);
  EXPECT_LT(distance(odometry.estimate().pose, truth.ends.back()), tolerance(GetParam()));
}

TEST_P(EachMode, BridgesDroppedSweeps) {
  const Drive truth = drive(hall(), 30);
  LidarOdometry odometry(config_of(GetParam()));
  for (std::size_t k = 0; k < truth.sweeps.size(); ++k) {
    if (k > 12 && k % 3 != 0) continue;
    odometry.process(truth.sweeps[k].cloud());
    ASSERT_TRUE(sane(odometry.estimate()));
  }
  EXPECT_LT(distance(odometry.estimate().pose, truth.ends[27]), tolerance(GetParam()));
}

TEST_P(EachMode, DoesNotFlyOffOverAPauseOfMinutes) {
  const Drive truth = drive(hall(), 20);
  LidarOdometry odometry(config_of(GetParam()));
  for (const RecordedSweep& sweep : truth.sweeps) odometry.process(sweep.cloud());
  RecordedSweep later = truth.sweeps.back();
  for (int k = 0; k < 5; ++k) {
    later.stamp_ns += k == 0 ? 600 * 1'000'000'000LL : period_ns;
    odometry.process(later.cloud());
    ASSERT_TRUE(sane(odometry.estimate()));
  }
  EXPECT_LT(distance(odometry.estimate().pose, truth.ends.back()), tolerance(GetParam()));
}

TEST_P(EachMode, StartsAnewAfterAnotherPlaceAltogether) {
  const Drive one = drive(hall(), 5);
  LidarOdometry odometry(config_of(GetParam()));
  for (const RecordedSweep& sweep : one.sweeps) odometry.process(sweep.cloud());
  // A sphere of 25 m: no point is near any wall of the hall.
  RecordedSweep other;
  for (int i = 0; i < 64; ++i) {
    for (int j = 0; j < 512; ++j) {
      const double a = 2.0 * std::numbers::pi * j / 512.0;
      const double b = 0.02 * (i - 32);
      const Eigen::Vector3d ray(std::cos(a) * std::cos(b), std::sin(a) * std::cos(b), std::sin(b));
      other.points.push_back((25.0 * ray).cast<float>());
    }
  }
  bool restarted = false;
  for (int k = 0; k < 10; ++k) {
    other.stamp_ns = 1'000'000'000 + k * period_ns;
    const Estimate& e = odometry.process(other.cloud());
    ASSERT_TRUE(sane(e));
    restarted = restarted || e.status == Status::restarted;
  }
  EXPECT_TRUE(restarted);
  EXPECT_EQ(odometry.estimate().total.restarts, 1u);
  EXPECT_TRUE(registered(odometry.estimate().status));
}

// Three seconds without a sweep, in which the vehicle drove on: nobody knows how far.
TEST(Default, AfterAPauseItGoesOnFromWhereItWas) {
  constexpr double speed = 1.0;
  Vector6d twist = Vector6d::Zero();
  twist[0] = speed;
  const auto sweep = [&](int k) {
    Pose end = Pose::Identity();
    end.translation().x() = 0.1 * speed * k;
    return scan(hall(), {}, end, twist, k * period_ns, static_cast<unsigned>(k + 1));
  };
  LidarOdometry odometry(config_of(Mode::default_));
  for (int k = 0; k < 20; ++k) odometry.process(sweep(k).cloud());
  const Pose before = odometry.estimate().pose;
  EXPECT_EQ(odometry.process(sweep(50).cloud()).status, Status::initialising);
  EXPECT_LT(distance(odometry.estimate().pose, before), 1e-9);
  Pose last = odometry.estimate().pose;
  for (int k = 51; k < 60; ++k) {
    const Estimate& e = odometry.process(sweep(k).cloud());
    ASSERT_TRUE(sane(e));
    EXPECT_EQ(e.status, Status::ok) << k;
    if (k > 52) {
      EXPECT_NEAR((last.inverse() * e.pose).translation().x(), 0.1 * speed, 0.02) << k;
    }
    last = e.pose;
  }
}

TEST_P(EachMode, UsesThePriorForLargeStepsAndIgnoresABrokenOne) {
  // Every sixth sweep of a fast drive, without point times: 0.6 m and 3.4 degrees between sweeps, from rest.
  ScannerModel model;
  model.times = false;
  LidarOdometry odometry(config_of(GetParam()));
  Vector6d step;
  step << 0.6, 0.1, 0.0, 0.0, 0.0, 0.35;
  Pose pose = Pose::Identity();
  for (int k = 0; k < 10; ++k) {
    if (k > 0) pose = pose * se3_exp(step);
    Prior prior;
    prior.pose = se3_exp(0.9 * step);
    const RecordedSweep sweep =
        scan(hall(), model, pose, Vector6d::Zero(), k * 10 * period_ns, static_cast<unsigned>(k));
    odometry.process(sweep.cloud(), &prior);
    ASSERT_TRUE(sane(odometry.estimate()));
  }
  EXPECT_LT(distance(odometry.estimate().pose, pose), 0.1);
  Prior broken;
  broken.pose.translation().x() = std::numeric_limits<double>::quiet_NaN();
  const RecordedSweep sweep = scan(hall(), model, pose, Vector6d::Zero(), 91 * period_ns, 99);
  odometry.process(sweep.cloud(), &broken);
  EXPECT_EQ(odometry.estimate().total.bad_priors, 1u);
  EXPECT_TRUE(sane(odometry.estimate()));
}

TEST_P(EachMode, TellsTheInstantOfItsPoseBeforehand) {
  const Drive truth = drive(hall(), 2);
  LidarOdometry odometry(config_of(GetParam()));
  for (const RecordedSweep& sweep : truth.sweeps) {
    const std::int64_t expected = odometry.stamps(sweep.cloud()).reference_ns;
    EXPECT_EQ(odometry.process(sweep.cloud()).stamp_ns, expected);
    const double after = 1e-9 * static_cast<double>(expected - sweep.stamp_ns);
    EXPECT_NEAR(after, GetParam() == Mode::genz ? 0.05 : 0.1, 1e-6);
  }
}

INSTANTIATE_TEST_SUITE_P(Modes, EachMode, testing::Values(Mode::kiss, Mode::genz, Mode::default_),
                         [](const auto& mode) {
                           return mode.param == Mode::default_ ? "default" : std::string(to_string(mode.param));
                         });

TEST(Config, NamesModesAndRefusesNonsense) {
  for (Mode mode : {Mode::kiss, Mode::genz, Mode::default_}) EXPECT_EQ(mode_from_string(to_string(mode)), mode);
  EXPECT_FALSE(mode_from_string("icp"));
  EXPECT_TRUE(check(Config{}));
  Config config;
  config.max_range = std::numeric_limits<double>::quiet_NaN();
  ASSERT_FALSE(check(config));
  config = {};
  config.min_range = 200.0;
  ASSERT_FALSE(check(config));
  EXPECT_NE(check(config).error().message.find("min_range"), std::string::npos);
}

TEST(Covariance, InParentAxesTurnsWithThePose) {
  Pose pose = Pose::Identity();
  pose.linear() = so3_exp({0.0, 0.0, std::numbers::pi / 2.0});
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal() << 1, 2, 3, 4, 5, 6;
  Vector6d expected;
  expected << 2, 1, 3, 5, 4, 6;
  EXPECT_LT((covariance_in_parent_axes(pose, covariance).diagonal() - expected).norm(), 1e-12);
}

}  // namespace
}  // namespace adit::lidar_odometry
