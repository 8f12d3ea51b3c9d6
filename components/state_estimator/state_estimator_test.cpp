#include "components/state_estimator/state_estimator.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "components/state_estimator/measurement_models.hpp"
#include "components/state_estimator/mission.hpp"
#include "idl/testing/allocation_counter.hpp"

namespace adit::state_estimator::test {
namespace {

TEST(StateEstimator, FollowsBothSensorsInEveryMode) {
  for (const Config& config : {Config::standard(), Config::paper(), Config::predecessor()}) {
    Mission run(config);
    run.until(60 * kSecond);
    const Status status = run.estimator->status(run.now);
    EXPECT_EQ(status.mode, Mode::fused);
    EXPECT_EQ(run.silent, 0);
    EXPECT_LT(run.error(), 1.5);
    EXPECT_NEAR(run.estimator->estimate(run.now)->speed, 2.0, 0.1);
    EXPECT_NEAR(run.estimator->estimate(run.now)->yaw_rate, 0.1, 0.01);
    EXPECT_GT(status.replays, 100u);  // latencies differ: thermal poses overtake the LiDAR's
    for (std::size_t i = 0; i < 2; ++i) EXPECT_GT(status.sensors[i].accepted, 500u) << status.sensors[i].name;
  }
}

TEST(StateEstimator, RelativePosesOfExactOdometryGiveTheExactPath) {
  Mission run(Config::standard());
  run.until(60 * kSecond);
  EXPECT_LT(run.error(), 0.3);
}

TEST(StateEstimator, CovarianceOfAnOutageGrowsAndCoversTheError) {
  Mission run(Config::standard());
  run.lidar = run.thermal = [](std::int64_t t) { return t < 20 * kSecond; };
  run.until(20 * kSecond);
  const double before = run.estimator->estimate(run.now)->pose_covariance(0, 0);
  run.until(30 * kSecond);
  const Estimate e = *run.estimator->estimate(run.now);
  EXPECT_GT(e.pose_covariance(0, 0), 100.0 * before);
  const Eigen::Vector2d error = e.pose.translation().head<2>() - on_circle(run.now).translation().head<2>();
  const Eigen::Matrix2d p = e.pose_covariance.topLeftCorner<2, 2>();
  EXPECT_LT(error.dot(p.inverse() * error), 9.21);
}

TEST(StateEstimator, PublishedStampsNeverGoBack) {
  Mission run(Config::standard());
  run.until(5 * kSecond);
  EXPECT_FALSE(run.estimator->publish(run.now));
  EXPECT_FALSE(run.estimator->publish(run.now - 100 * kMillisecond));
  EXPECT_TRUE(run.estimator->publish(run.now + 1));
}

TEST(StateEstimator, WithoutAbsoluteSensorsHeadingVarianceNeverShrinks) {
  std::unique_ptr<StateEstimator> paper = make(Config::paper());
  paper->start(0);
  double last = 0.0;
  for (std::int64_t t = 100 * kMillisecond; t < 60 * kSecond; t += 100 * kMillisecond) {
    paper->add_odometry(0, sample(t, on_circle(t)), t);
    const double variance = paper->state().p(kYaw, kYaw);
    // Until the start's uncertainty of the yaw rate is worn off, measuring it also tells about the heading.
    if (t > 5 * kSecond) {
      EXPECT_GE(variance, last * (1.0 - 1e-12));
    }
    last = variance;
  }
}

TEST(StateEstimator, ThermalScaleAndBiasAreFoundAndCarriedThroughAnOutage) {
  Mission run(Config::standard());
  // The thermal odometry is 8 % short and turns 2 mrad/s too much. 60 s with LiDAR, 30 s without.
  StateEstimator& e = *run.estimator;
  Pose thermal = Pose::Identity();
  std::int64_t last = 0;
  const auto drive = [&](std::int64_t end, bool with_lidar) {
    while (run.now < end) {
      run.now += 10 * kMillisecond;
      if (with_lidar && run.now % (100 * kMillisecond) == 0) {
        e.add_odometry(0, sample(run.now, on_circle(run.now)), run.now);
      }
      if (run.now % (40 * kMillisecond) != 0) continue;
      Pose step = on_circle(last).inverse() * on_circle(run.now);
      step.translation() *= 0.92;
      step.linear() = step.linear() * so3_exp({0.0, 0.0, 0.002 * seconds_between(last, run.now)});
      thermal = thermal * step;
      e.add_odometry(1, sample(run.now, thermal), run.now);
      last = run.now;
    }
  };
  drive(60 * kSecond, true);
  EXPECT_NEAR(e.status(run.now).thermal_scale, 0.92, 0.01);
  EXPECT_NEAR(e.state().x(kThermalYawBias), 0.002, 0.0005);
  const double before = run.error();
  drive(90 * kSecond, false);
  EXPECT_LT(run.error() - before, 0.6);  // 1 % of 60 m; without the scale state it would be 4.8 m
  EXPECT_EQ(e.status(run.now).mode, Mode::thermal);
}

// A camera whose driver stamps what arrived 80 ms ago, on a car that speeds up and slows down: with an IMU, which knows
// the acceleration, the delay is found, with a deviation that covers what is left of it, and the position is the
// LiDAR's. At a constant speed, or where the acceleration is only what the odometries' noise makes of it, nothing is
// claimed.
TEST(StateEstimator, ThermalDelayIsFoundWhereTheSpeedChanges) {
  constexpr std::int64_t late = 80 * kMillisecond;
  struct Case {
    double swing;  // m/s, of a speed of 8 m/s with a period of 12 s
    bool imu;
  };
  for (const auto& [swing, imu] : {Case{0.0, true}, Case{3.0, false}, Case{6.0, true}}) {
    constexpr double w = 2.0 * M_PI / 12.0;
    const auto truth = [&, swing = swing](std::int64_t t) {
      const double s = seconds_between(0, t);
      return planar(8.0 * s - swing / w * std::cos(w * s), 0.0, 0.0);
    };
    Config config = Config::standard();
    config.imu.enabled = imu;
    const std::unique_ptr<StateEstimator> e = make(config);
    std::mt19937_64 random(7);
    std::normal_distribution<double> noise;
    const auto measured = [&](std::int64_t t) {
      Pose pose = truth(t);
      pose.translation().x() += 0.005 * noise(random);
      return pose;
    };
    e->start(0);
    std::int64_t now = 0;
    double halfway = 0.0;
    while (now < 40 * kSecond) {
      now += 10 * kMillisecond;
      const double acceleration = now < 2 * kSecond ? 0.0 : swing * w * std::cos(w * seconds_between(0, now));
      if (imu) e->add_imu({now, Eigen::Vector3d::Zero(), {acceleration, 0.0, 9.81}}, now);
      if (now % (50 * kMillisecond) == 0) e->add_odometry(1, sample(now, measured(now - late)), now);
      if (now % (100 * kMillisecond) == 0) e->add_odometry(0, sample(now, measured(now)), now);
      if (now == 20 * kSecond) halfway = e->state().x(kX);
    }
    const Status status = e->status(now);
    const double way = (truth(now).translation() - truth(20 * kSecond).translation()).x();
    EXPECT_NEAR(e->state().x(kX) - halfway, way, 0.3);
    if (swing == 0.0 || !imu) {
      EXPECT_NEAR(status.thermal_delay, 0.0, 0.03);
      EXPECT_GT(status.thermal_delay_sigma, 0.025);
    } else {
      EXPECT_NEAR(status.thermal_delay, 0.08, 0.02);
      EXPECT_LT(std::abs(status.thermal_delay - 0.08), 3.0 * status.thermal_delay_sigma);
    }
  }
}

TEST(StateEstimator, RelativePredictionHasTheCovarianceOfTheMotionAlone) {
  Mission run(Config::standard());
  run.until(60 * kSecond);
  const std::int64_t from = run.now - 200 * kMillisecond, to = run.now + 100 * kMillisecond;
  const std::optional<RelativePrediction> p = run.estimator->predict_motion(from, to);
  ASSERT_TRUE(p);
  const Pose truth = on_circle(from).inverse() * on_circle(to);
  EXPECT_NEAR(p->motion.x(), truth.translation().x(), 0.03);
  EXPECT_NEAR(p->motion.z(), 0.03, 0.005);
  const Estimate e = *run.estimator->estimate(to);
  EXPECT_LT(p->covariance(0, 0), 0.2 * (e.pose_covariance(0, 0) + e.pose_covariance(1, 1)));
  EXPECT_GT(p->covariance(0, 0), 0.0);
  EXPECT_FALSE(run.estimator->predict_motion(to, from));
  EXPECT_FALSE(run.estimator->predict_motion(run.now - 20 * kSecond, to));
}

TEST(StateEstimator, ClosureMovesTheMapNotOdom) {
  Mission run(Config::standard());
  run.until(30 * kSecond);
  const Pose before = run.estimator->estimate(run.now)->pose;
  const PlanarPose truth(50.0, 60.0, 1.0);
  EXPECT_EQ(run.estimator->add_closure(run.now - kSecond, truth, 1e-4 * Eigen::Matrix3d::Identity()),
            MapCorrection::Outcome::applied);
  EXPECT_EQ((run.estimator->estimate(run.now)->pose.matrix() - before.matrix()).norm(), 0.0);
  const Estimate then = *run.estimator->estimate(run.now - kSecond);
  const PlanarPose odom(then.pose.translation().x(), then.pose.translation().y(), yaw(then.pose.linear()));
  const PlanarPose corrected = compose(run.estimator->map_correction().map_odom(), odom);
  EXPECT_LT((corrected - truth).norm(), 0.05);
  EXPECT_EQ(run.estimator->add_closure(-kSecond, truth, Eigen::Matrix3d::Identity()),
            MapCorrection::Outcome::malformed);
}

TEST(StateEstimator, StandsStillWithZeroVelocityUpdates) {
  Config config = Config::standard();
  config.imu.enabled = true;
  std::unique_ptr<StateEstimator> e = make(config);
  e->start(0);
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal;
  std::int64_t now = 0;
  for (; now < 60 * kSecond; now += 5 * kMillisecond) {
    ImuSample imu;
    imu.stamp_ns = now;
    imu.angular_rate = 0.002 * Eigen::Vector3d(normal(random), normal(random), normal(random)) +
                       Eigen::Vector3d(0, 0, 0.01);  // a bias
    imu.specific_force =
        0.03 * Eigen::Vector3d(normal(random), normal(random), normal(random)) + Eigen::Vector3d(0.0, 0.0, 9.81);
    e->add_imu(imu, now);
    if (now % (100 * kMillisecond) == 0) {
      e->add_odometry(0, sample(now, planar(0.003 * normal(random), 0.003 * normal(random), 0.0)), now);
    }
  }
  const Estimate estimate = *e->estimate(now);
  EXPECT_LT(std::abs(estimate.speed), 0.01);
  EXPECT_LT(estimate.pose.translation().norm(), 0.1);
  EXPECT_LT(std::abs(yaw(estimate.pose.linear())), 0.01);
  EXPECT_NEAR(e->state().x(kGyroBias), 0.01, 0.001);
  EXPECT_GT(e->status(now).sensors[static_cast<std::size_t>(e->sensor("zero_velocity"))].accepted, 100u);
}

TEST(StateEstimator, GnssAnchorsAndMultipathIsRejected) {
  Config config = Config::predecessor();
  config.gate.enabled = true;
  std::unique_ptr<StateEstimator> e = make(config);
  e->start(0);
  std::mt19937_64 random(10);
  std::normal_distribution<double> normal;
  std::int64_t now = 0;
  int wrong = 0;
  for (; now < 60 * kSecond; now += 100 * kMillisecond) {
    e->add_odometry(0, sample(now, planar(3.0, 4.0, 0.3).inverse() * on_circle(now)), now);
    if (now % kSecond != 0) continue;
    GnssSample fix;
    fix.stamp_ns = now;
    const Eigen::Vector2d truth = on_circle(now).translation().head<2>();
    fix.position = truth + 0.05 * Eigen::Vector2d(normal(random), normal(random));
    fix.covariance = 0.0025 * Eigen::Matrix2d::Identity();
    if (now > 30 * kSecond && now % (5 * kSecond) == 0) {
      fix.position.x() += 10.0;
      ++wrong;
    }
    e->add_gnss(fix, now);
  }
  EXPECT_LT((e->estimate(now - 1)->pose.translation() - on_circle(now - 1).translation()).norm(), 0.3);
  const SensorReport gnss = e->status(now).sensors[static_cast<std::size_t>(e->sensor("gnss"))];
  EXPECT_EQ(gnss.rejected, static_cast<std::uint64_t>(wrong));
  GnssSample bad;
  bad.covariance.setZero();
  EXPECT_EQ(e->add_gnss(bad, now), Verdict::malformed);
}

TEST(StateEstimator, ANewSensorIsOneModelAndOneCall) {
  Config config = Config::standard();
  config.odometries.resize(1);
  std::unique_ptr<StateEstimator> e = make(config);
  SensorModel wheel;
  wheel.model = std::make_unique<Speed>();
  wheel.moves = true;
  const int index = e->add_sensor("wheel", std::move(wheel));
  ASSERT_GE(index, 0);
  e->start(0);
  for (std::int64_t t = 20 * kMillisecond; t < 5 * kSecond; t += 20 * kMillisecond) {
    Measurement m;
    m.sensor = static_cast<std::uint8_t>(index);
    m.stamp_ns = t;
    m.rows = 1;
    m.value.x() = 3.0;
    m.covariance(0, 0) = 0.01;
    EXPECT_EQ(e->add_measurement(m, t), Verdict::fused);
  }
  EXPECT_NEAR(e->estimate(5 * kSecond)->speed, 3.0, 0.05);
}

TEST(StateEstimator, HeightAndTiltAreCarriedFromTheOdometry) {
  std::unique_ptr<StateEstimator> e = make(Config::standard());
  e->start(0);
  const Eigen::Matrix3d nose_up = so3_exp({0.0, -0.1, 0.0});
  for (int i = 0; i <= 100; ++i) {
    Pose pose = planar(0.2 * i * std::cos(0.1), 0.0, 0.0);
    pose.translation().z() = 0.2 * i * std::sin(0.1);
    pose.linear() = nose_up;
    e->add_odometry(0, sample(i * 100 * kMillisecond, pose), i * 100 * kMillisecond);
  }
  const Estimate estimate = *e->estimate(10 * kSecond);
  EXPECT_NEAR(estimate.pose.translation().z(), 20.0 * std::sin(0.1), 1e-6);
  EXPECT_NEAR(estimate.pose.translation().x(), 20.0 * std::cos(0.1), 0.1);
  EXPECT_LT((estimate.pose.linear() - nose_up).norm(), 0.01);
}

TEST(StateEstimator, SteadyStateDoesNotAllocate) {
  Config config = Config::standard();
  config.imu.enabled = true;
  std::unique_ptr<StateEstimator> e = make(config);
  e->start(0);
  const auto run = [&](std::int64_t from, std::int64_t to) {
    for (std::int64_t now = from; now < to; now += 10 * kMillisecond) {
      ImuSample imu;
      imu.stamp_ns = now;
      imu.angular_rate.z() = 0.1;
      imu.specific_force.z() = 9.81;
      e->add_imu(imu, now);
      if (now % (100 * kMillisecond) == 0) {
        e->add_odometry(0, sample(now - 50 * kMillisecond, on_circle(now - 50 * kMillisecond)), now);
      }
      if (now % (30 * kMillisecond) == 0) e->add_odometry(1, sample(now, on_circle(now)), now);
      e->publish(now);
      e->predict_motion(now - 100 * kMillisecond, now + 50 * kMillisecond);
    }
  };
  run(kSecond, 3 * kSecond);
  const std::uint64_t before = adit::test::allocations();
  run(3 * kSecond, 30 * kSecond);
  EXPECT_EQ(adit::test::allocations() - before, 0u);
}

TEST(Config, ChecksNameWhatIsWrong) {
  Config config = Config::standard();
  config.odometries[1].name = "lidar";
  EXPECT_FALSE(StateEstimator::create(config));
  config = Config::standard();
  config.odometries.push_back(config.odometries[0]);
  config.odometries[2].name = "third";
  const Result<void> three = check(config);
  ASSERT_FALSE(three);
  EXPECT_NE(three.error().message.find("relative_pose"), std::string::npos);
  config = Config::standard();
  config.process.noise.jerk = -1.0;
  EXPECT_FALSE(check(config));
  config = Config::standard();
  config.odometries[0].odometry.sigma_yaw = std::nan("");
  EXPECT_FALSE(check(config));
  for (const Config& good : {Config::standard(), Config::paper(), Config::predecessor()}) EXPECT_TRUE(check(good));
}

}  // namespace
}  // namespace adit::state_estimator::test
