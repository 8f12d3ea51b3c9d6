#include "components/lidar_odometry/inertial_predictor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "components/lidar_odometry/sweep.hpp"
#include "components/lidar_odometry/test_scene.hpp"

namespace adit::lidar_odometry {
namespace {

constexpr std::int64_t ms = 1'000'000;
constexpr double degree = M_PI / 180.0;

Pose mounting() {  // of the IMU on the LiDAR
  Pose pose = Pose::Identity();
  pose.linear() = so3_exp({0.0, 0.0, 1.5});
  pose.translation() << -0.1, 0.05, -0.35;
  return pose;
}

// The LiDAR of a walking robot, after one second of standing: 1.4 m/s, 2.8 strides a second, turning by degrees to and
// fro within a sweep.
Pose walking(double time) {
  const double t = time - 1.0;
  const double ramp = t <= 0.0 ? 0.0 : t >= 1.0 ? 1.0 : t * t * (3.0 - 2.0 * t);
  const double way = t <= 0.0 ? 0.0 : t >= 1.0 ? 0.5 + (t - 1.0) : t * t * t - 0.5 * t * t * t * t;
  const double phase = 2.0 * M_PI * 2.8 * t;
  Pose pose = Pose::Identity();
  pose.linear() =
      so3_exp({0.0, 0.0, 0.05 * ramp * t}) *
      so3_exp(ramp * degree *
              Eigen::Vector3d(2.0 * std::sin(phase), 1.6 * std::sin(2.0 * phase + 1.0), 1.5 * std::sin(phase + 0.4)));
  pose.translation() << 1.4 * way, 0.03 * ramp * std::sin(phase), 0.015 * ramp * std::sin(2.0 * phase);
  return pose;
}

// What the IMU on that LiDAR measures: derivatives by differences, bias, white noise.
InertialSample measured(std::int64_t stamp_ns, std::mt19937& random, double noise = 1.0) {
  constexpr double h = 1e-4;
  const double time = 1e-9 * static_cast<double>(stamp_ns);
  const auto imu = [](double t) { return Pose(walking(t) * mounting()); };
  const Pose before = imu(time - h), now = imu(time), after = imu(time + h);
  std::normal_distribution<double> normal;
  const auto vector = [&](double sigma) {
    const double x = normal(random), y = normal(random);
    return Eigen::Vector3d(sigma * noise * Eigen::Vector3d(x, y, normal(random)));
  };
  InertialSample sample;
  sample.stamp_ns = stamp_ns;
  sample.rate = so3_log(before.linear().transpose() * after.linear()) / (2.0 * h) +
                noise * Eigen::Vector3d(0.01, -0.005, 0.008) + vector(3e-3);
  sample.acceleration =
      now.linear().transpose() * ((after.translation() - 2.0 * now.translation() + before.translation()) / (h * h) +
                                  Eigen::Vector3d(0, 0, 9.81)) +
      noise * Eigen::Vector3d(0.02, 0.03, -0.02) + vector(0.03);
  return sample;
}

SweepStamps sweep(int k) {
  return {k * 100 * ms, (k + 1) * 100 * ms, (k + 1) * 100 * ms};
}
Pose truth(int k) {
  return walking(1e-9 * static_cast<double>(sweep(k).reference_ns));
}

// A registration that finds the truth but for a millimetre along what it sees.
Estimate registered_at(int k, const Vector6d& sigma = Vector6d::Constant(1e-3)) {
  Estimate estimate;
  estimate.status = k == 0 ? Status::initialising : Status::ok;
  estimate.stamp_ns = sweep(k).reference_ns;
  estimate.pose = truth(k);
  if (k > 0) estimate.twist = se3_log(truth(k - 1).inverse() * truth(k)) / 0.1;
  estimate.information.diagonal() = sigma.cwiseAbs2().cwiseInverse();
  return estimate;
}

struct Feed {
  InertialPredictor predictor{{.lidar_from_imu = mounting()}};
  std::mt19937 random{7};
  std::int64_t next_ns = 0;
  double noise = 1.0;
  std::function<bool(InertialSample&)> change = [](InertialSample&) { return true; };  // false: it is lost

  void until(std::int64_t stamp_ns) {
    for (; next_ns <= stamp_ns; next_ns += 5 * ms) {
      InertialSample sample = measured(next_ns, random, noise);
      if (change(sample)) predictor.add(sample);
    }
  }
  std::optional<Prior> predict(int k) {
    until(sweep(k).last_ns);
    return predictor.predict(sweep(k));
  }
  void walk(int first, int last) {
    for (int k = first; k < last; ++k) {
      predict(k);
      predictor.correct(registered_at(k));
    }
  }
};

Pose increment(int k) {
  return truth(k - 1).inverse() * truth(k);
}

TEST(InertialPredictor, UndistortsASweepOfAWalkingRobotToAMillimetre) {
  Feed feed;
  feed.noise = 0.0;
  feed.walk(0, 40);
  double worst = 0.0, worst_constant = 0.0;
  for (int k = 40; k < 50; ++k) {
    const std::optional<Prior> prior = feed.predict(k);
    ASSERT_TRUE(prior);
    ASSERT_TRUE(follows(prior->sweep, sweep(k).first_ns, {0.0, 0.1}));
    const SweepMotion motion(prior->sweep, sweep(k).first_ns, {0.0, 0.1}, 0.1);
    const SweepMotion constant(se3_log(increment(k)) / 0.1, {0.0, 0.1}, 0.1);
    for (double t = 0.0; t <= 0.1; t += 0.0037) {
      const Eigen::Vector3d point(10.0 * std::cos(60.0 * t), 10.0 * std::sin(60.0 * t),
                                  2.0);  // in the sensor frame, then
      const Eigen::Vector3d expected = truth(k).inverse() * (walking(0.1 * k + t) * point);
      worst = std::max(worst, (motion.compensate(point, t) - expected).norm());
      worst_constant = std::max(worst_constant, (constant.compensate(point, t) - expected).norm());
    }
    feed.predictor.correct(registered_at(k));
  }
  EXPECT_LT(worst, 1e-3);
  EXPECT_GT(worst_constant, 0.2);  // what is without it
}

// The registration is off by a millimetre and a milliradian, as it says.
TEST(InertialPredictor, PredictsWithHonestInformation) {
  Feed feed;
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0.0, 1e-3);
  double nees = 0.0;
  Pose last = Pose::Identity();
  for (int k = 0; k < 140; ++k) {
    const std::optional<Prior> prior = feed.predict(k);
    ASSERT_TRUE(prior);
    if (k >= 40) {
      const Vector6d error = se3_log((last * prior->pose).inverse() * truth(k));
      EXPECT_LT(error.head<3>().norm(), 6e-3) << k;
      EXPECT_LT(error.tail<3>().norm(), 3e-3) << k;
      nees += error.dot(prior->information * error) / 6.0 / 100.0;
    }
    Vector6d noise;
    for (double& component : noise) component = normal(random);
    Estimate estimate = registered_at(k);
    estimate.pose = estimate.pose * se3_exp(noise);
    // What a registration makes of both.
    if (k > 1) {
      const Matrix6d sum = prior->information + estimate.information;
      const Pose guess = last * prior->pose;
      const Vector6d step = sum.ldlt().solve(estimate.information * se3_log(guess.inverse() * estimate.pose));
      estimate.pose = guess * se3_exp(step);
    }
    last = estimate.pose;
    feed.predictor.correct(estimate);
  }
  EXPECT_GT(nees, 0.1);
  EXPECT_LT(nees, 1.5);
}

TEST(InertialPredictor, LeavesTheFirstMotionToTheRegistration) {
  Feed feed;
  const std::optional<Prior> first = feed.predict(0);
  ASSERT_TRUE(first);
  EXPECT_FALSE(first->sweep.empty());
  feed.predictor.correct(registered_at(0));
  const std::optional<Prior> second = feed.predict(1);
  ASSERT_TRUE(second);
  EXPECT_FALSE(second->sweep.empty());
  EXPECT_LT(second->information(0, 0), 10.0);
  EXPECT_GT(second->sweep_covariance(0, 0), 1.0);
  feed.predictor.correct(registered_at(1));
  const std::optional<Prior> third = feed.predict(2);
  ASSERT_TRUE(third);
  EXPECT_GT(third->information(0, 0), 100.0);
  EXPECT_GT(third->information(3, 3), 1e4);
}

// Switched on while walking: the first sweeps find the velocity, and until then nothing is claimed of it.
TEST(InertialPredictor, FindsTheVelocityOfAMovingStart) {
  Feed feed;
  feed.next_ns = 2'500 * ms;
  for (int k = 30; k < 50; ++k) {
    const std::optional<Prior> prior = feed.predict(k);
    ASSERT_TRUE(prior);
    if (k > 30) {
      const Vector6d error = se3_log(prior->pose.inverse() * increment(k));
      EXPECT_LT(error.dot(prior->information * error), 40.0) << k;
      EXPECT_LT(error.head<3>().norm(), k < 40 ? 1.0 : 5e-3) << k;
    }
    Estimate estimate = registered_at(k);
    if (k == 30) estimate.status = Status::initialising;
    feed.predictor.correct(estimate);
  }
}

// Nothing is seen along x for three seconds: the IMU carries it, and says how well.
TEST(InertialPredictor, CarriesADirectionThatTheRegistrationDoesNotSee) {
  Feed feed;
  feed.walk(0, 60);
  Pose carried = truth(59);
  double variance = 0.0;
  for (int k = 60; k < 90; ++k) {
    const std::optional<Prior> prior = feed.predict(k);
    ASSERT_TRUE(prior);
    Estimate estimate = registered_at(k);
    const Pose guess = carried * prior->pose;
    estimate.pose.translation().x() = guess.translation().x();
    estimate.information(0, 0) = 0.0;
    feed.predictor.correct(estimate);
    carried = estimate.pose;
    const double sigma = std::sqrt(prior->information.inverse()(0, 0));
    variance = (std::sqrt(variance) + sigma) * (std::sqrt(variance) + sigma);  // a wrong velocity adds up
  }
  const double error = std::abs(carried.translation().x() - truth(89).translation().x());
  EXPECT_LT(error, 0.3);
  EXPECT_LT(error, 3.0 * std::sqrt(variance));
  EXPECT_LT(std::sqrt(variance), 2.0);
}

TEST(InertialPredictor, RefusesWhatIsNoSample) {
  InertialPredictor predictor;
  InertialSample sample;
  sample.acceleration.z() = 9.81;
  sample.stamp_ns = 100 * ms;
  EXPECT_TRUE(predictor.add(sample));
  EXPECT_FALSE(predictor.add(sample));  // repeated
  sample.stamp_ns = 50 * ms;
  EXPECT_FALSE(predictor.add(sample));  // late
  sample.stamp_ns = 105 * ms;
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity(), 1e6}) {
    InertialSample wrong = sample;
    wrong.rate.y() = bad;
    EXPECT_FALSE(predictor.add(wrong));
    wrong = sample;
    wrong.acceleration.x() = bad;
    EXPECT_FALSE(predictor.add(wrong));
  }
  EXPECT_EQ(predictor.counters().samples, 9u);
  EXPECT_EQ(predictor.counters().refused, 8u);
}

TEST(InertialPredictor, SaysNothingWithoutSamplesOrOverAGapAndGoesOnAfterIt) {
  EXPECT_FALSE(InertialPredictor().predict(sweep(0)));
  Feed feed;
  feed.walk(0, 40);
  // The second half of sweep 40 is missing.
  feed.change = [](InertialSample& s) { return s.stamp_ns < 4'040 * ms || s.stamp_ns > 4'095 * ms; };
  EXPECT_FALSE(feed.predict(40));
  feed.predictor.correct(registered_at(40));
  EXPECT_EQ(feed.predictor.counters().uncovered, 1u);
  const std::optional<Prior> next = feed.predict(41);
  ASSERT_TRUE(next);
  feed.predictor.correct(registered_at(41));
  feed.walk(42, 60);
  const Vector6d error = se3_log(feed.predict(60)->pose.inverse() * increment(60));
  EXPECT_LT(error.head<3>().norm(), 4e-3);
  EXPECT_LT(error.tail<3>().norm(), 1e-3);
  // Single lost samples do not matter.
  feed.predictor.correct(registered_at(60));
  feed.change = [](InertialSample& s) { return s.stamp_ns / (5 * ms) % 7 != 0; };
  EXPECT_TRUE(feed.predict(61));
  // Repeated and late clouds are not predicted.
  feed.predictor.correct(registered_at(61));
  EXPECT_FALSE(feed.predictor.predict(sweep(61)));
  EXPECT_FALSE(feed.predictor.predict(sweep(30)));
}

TEST(InertialPredictor, BelievesANewTimeBaseAfterAWhile) {
  Feed feed;
  feed.walk(0, 40);
  InertialSample ahead = measured(4000 * ms, feed.random);
  ahead.stamp_ns += 1'000'000 * ms;
  EXPECT_TRUE(feed.predictor.add(ahead));
  EXPECT_FALSE(feed.predict(40));  // nine refused samples, a gap
  feed.predictor.correct(registered_at(40));
  feed.walk(41, 60);
  EXPECT_TRUE(feed.predict(60));
  EXPECT_LE(feed.predictor.counters().uncovered, 3u);
}

// Mounted another way round than was said.
TEST(InertialPredictor, LeavesOutAnImuThatContradictsWhatIsSeen) {
  Feed feed;
  feed.change = [](InertialSample& s) {
    s.rate = -s.rate;
    s.acceleration = Eigen::Vector3d(s.acceleration.x(), -s.acceleration.y(), -s.acceleration.z());
    return true;
  };
  int predicted = 0;
  for (int k = 0; k < 60; ++k) {
    predicted += feed.predict(k) ? 1 : 0;
    feed.predictor.correct(registered_at(k));
  }
  EXPECT_GE(feed.predictor.counters().contradicted, 5u);
  EXPECT_LT(predicted, 40);
}

TEST(InertialPredictor, GoesOnAfterLostSweepsAndAfterAReset) {
  Feed feed;
  feed.walk(0, 40);
  Pose guess = truth(39);
  for (int k = 40; k < 43; ++k) {
    const std::optional<Prior> prior = feed.predict(k);
    ASSERT_TRUE(prior);
    guess = guess * prior->pose;
    Estimate lost = registered_at(k);
    lost.status = Status::lost;
    lost.pose = guess;
    lost.information.setZero();
    feed.predictor.correct(lost);
  }
  EXPECT_LT((guess.translation() - truth(42).translation()).norm(), 0.05);
  feed.predictor.clear();
  EXPECT_FALSE(feed.predictor.predict(sweep(43)));
  feed.next_ns = 4300 * ms;
  feed.walk(43, 70);
  const Vector6d error = se3_log(feed.predict(70)->pose.inverse() * increment(70));
  EXPECT_LT(error.norm(), 6e-3);
}

// Both together, on the sweeps of that robot in a hall.
TEST(InertialPredictor, MakesTheOdometryOfAWalkingRobotExact) {
  const auto largest_error = [](bool with_imu, int begin = 5) {
    LidarOdometry odometry{Config{}};
    Feed feed;
    feed.next_ns = sweep(begin).first_ns - 500 * ms;
    Pose first = Pose::Identity();
    double worst = 0.0;
    for (int k = begin; k < begin + 35; ++k) {
      ScannerModel model;
      model.noise = 0.01;
      const RecordedSweep cloud = scan(
          hall(), model, [&](double t) { return walking(0.1 * k + t); }, sweep(k).first_ns, static_cast<unsigned>(k));
      const SweepStamps stamps = odometry.stamps(cloud.cloud());
      EXPECT_NEAR(static_cast<double>(stamps.last_ns), static_cast<double>(sweep(k).last_ns), 1000.0);
      feed.until(stamps.last_ns);
      const std::optional<Prior> prior = with_imu ? feed.predictor.predict(stamps) : std::nullopt;
      const Estimate& estimate = odometry.process(cloud.cloud(), prior ? &*prior : nullptr);
      feed.predictor.correct(estimate);
      if (k == begin) first = truth(k) * estimate.pose.inverse();
      worst = std::max(worst, ((first * estimate.pose).translation() - truth(k).translation()).norm());
    }
    return worst;
  };
  EXPECT_LT(largest_error(true), 0.015);
  EXPECT_GT(largest_error(false), 0.05);
  constexpr int in_mid_gait = 30;
  EXPECT_LT(largest_error(true, in_mid_gait), 0.03);
}

TEST(LidarOdometry, IgnoresPosesThatDoNotReachOverTheSweep) {
  LidarOdometry odometry{Config{}};
  const RecordedSweep cloud = scan(hall(), {}, Pose::Identity(), Vector6d::Zero(), 0, 1);
  odometry.process(cloud.cloud());
  std::vector<StampedPose> poses{{100 * ms, Pose::Identity()}, {150 * ms, Pose::Identity()}};
  Prior prior;
  prior.sweep = poses;
  RecordedSweep next = cloud;
  next.stamp_ns = 100 * ms;
  EXPECT_EQ(odometry.process(next.cloud(), &prior).total.bad_priors, 1u);  // half of it
  poses.back().stamp_ns = 200 * ms;
  poses.push_back({190 * ms, Pose::Identity()});
  prior.sweep = poses;
  next.stamp_ns = 200 * ms;
  EXPECT_EQ(odometry.process(next.cloud(), &prior).total.bad_priors, 2u);  // not in order
  poses = {{300 * ms, Pose::Identity()}, {400 * ms, Pose::Identity()}};
  poses.back().pose.translation().x() = std::nan("");
  prior.sweep = poses;
  next.stamp_ns = 300 * ms;
  const Estimate& estimate = odometry.process(next.cloud(), &prior);
  EXPECT_EQ(estimate.total.bad_priors, 3u);
  EXPECT_EQ(estimate.status, Status::ok);
  EXPECT_LT(estimate.pose.translation().norm(), 0.01);
}

}  // namespace
}  // namespace adit::lidar_odometry
