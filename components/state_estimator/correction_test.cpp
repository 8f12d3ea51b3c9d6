#include "components/state_estimator/correction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include <Eigen/Dense>

#include "components/state_estimator/filter.hpp"
#include "components/state_estimator/measurement_models.hpp"
#include "components/state_estimator/random_updates.hpp"
#include "components/state_estimator/test_support.hpp"

namespace adit::state_estimator {
namespace {

constexpr std::pair<int, int> poses[] = {{kX, kYaw},
                                         {clone_index(0), clone_index(0) + 2},
                                         {clone_index(1), clone_index(1) + 2},
                                         {clone_index(2), clone_index(2) + 2}};

FilterState random_state(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  FilterState s;
  s.stamp_ns = 0;
  StateMatrix a;
  for (int i = 0; i < kStates; ++i) {
    s.x(i) = normal(random);
    for (int j = 0; j < kStates; ++j) a(i, j) = 0.3 * normal(random);
  }
  s.p = a * a.transpose();
  return s;
}

TEST(Correction, ChiSquareTable) {
  EXPECT_NEAR(chi_square(2, Quantile::p99_9), 13.8155, 1e-4);
  EXPECT_NEAR(chi_square(1, Quantile::p95), 3.8415, 1e-4);
  EXPECT_NEAR(chi_square(3, Quantile::p99), 11.3449, 1e-4);
}

TEST(Correction, EqualsTheInformationForm) {
  std::mt19937_64 random(1);
  for (int trial = 0; trial < 50; ++trial) {
    FilterState s = random_state(random);
    s.p += 0.1 * StateMatrix::Identity();
    s.x(kYaw) = 0.1;
    const Measurement m = test::rates(0, 0, 1.0, 0.2, 0.3, 0.05);
    const Innovation innovation = project(s, SpeedAndYawRate().linearize(s, m), m);
    const auto h = innovation.jacobian.topRows<2>();
    const Eigen::Matrix2d r = innovation.covariance.topLeftCorner<2, 2>();
    const StateMatrix information = s.p.inverse() + h.transpose() * r.inverse() * h;
    const StateMatrix p = information.inverse();
    const StateVector x = s.x + p * h.transpose() * r.inverse() * innovation.value.head<2>();
    // The covariance belongs to e_p - J p e_psi of each pose: as seen from where the pose is now.
    StateMatrix moved = StateMatrix::Identity();
    for (const auto& [position, heading] : poses) {
      moved(position, heading) = -(x - s.x)(position + 1);
      moved(position + 1, heading) = (x - s.x)(position);
    }
    ASSERT_TRUE(correct(s, innovation));
    EXPECT_LT((s.p - moved * p * moved.transpose()).norm(), 1e-9 * (1.0 + s.p.norm()));
    for (int i = 0; i < kFirstClone; ++i) {
      if (i != kYaw) {
        EXPECT_NEAR(s.x(i), x(i), 1e-9);
      }
    }
    EXPECT_NEAR(wrap_angle(s.x(kYaw) - x(kYaw)), 0.0, 1e-9);
  }
}

TEST(Correction, DistanceByHand) {
  FilterState s;
  s.p(kSpeed, kSpeed) = 3.0;
  s.p(kYawRate, kYawRate) = 0.01;
  const Measurement m = test::rates(0, 0, 4.0, 0.0, 1.0, 0.1);
  const Innovation i = project(s, SpeedAndYawRate().linearize(s, m), m);
  EXPECT_NEAR(squared_distance(i), 4.0, 1e-12);  // 4^2 / (3 + 1)
}

TEST(Correction, RefusesWhatIsNotANumberAndChangesNothing) {
  std::mt19937_64 random(2);
  FilterState s = random_state(random);
  const FilterState before = s;
  Measurement m = test::rates(0, 0, std::nan(""), 0.2, 0.3, 0.05);
  EXPECT_FALSE(correct(s, project(s, SpeedAndYawRate().linearize(s, m), m)));
  m = test::rates(0, 0, 1.0, 0.2, 0.3, 0.05);
  m.covariance *= -1e6;
  EXPECT_FALSE(correct(s, project(s, SpeedAndYawRate().linearize(s, m), m)));
  m.covariance.setConstant(std::numeric_limits<double>::infinity());
  EXPECT_FALSE(correct(s, project(s, SpeedAndYawRate().linearize(s, m), m)));
  m.rows = 0;
  EXPECT_FALSE(correct(s, project(s, SpeedAndYawRate().linearize(s, m), m)));
  EXPECT_EQ((s.x - before.x).norm(), 0.0);
  EXPECT_EQ((s.p - before.p).norm(), 0.0);
}

TEST(Correction, AnglesStayWrapped) {
  FilterState s;
  s.x(kYaw) = 3.1;
  s.p(kYaw, kYaw) = s.p(kYawRate, kYawRate) = 1.0;
  s.p(kYaw, kYawRate) = s.p(kYawRate, kYaw) = 0.99;
  const Measurement m = test::rates(0, 0, 0.0, 0.3, 1.0, 0.01);
  ASSERT_TRUE(correct(s, project(s, SpeedAndYawRate().linearize(s, m), m)));
  EXPECT_LT(s.x(kYaw), 0.0);
  EXPECT_GT(s.x(kYaw), -M_PI);
}

// Motions relative to an earlier pose cannot tell how both lie in odom: after an outage that left heading and speed
// unknown, however far the estimate is corrected, the heading's variance does not shrink.
TEST(Correction, RelativePosesSayNothingOfTheHeading) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Filter filter;
  SensorModel lidar;
  lidar.model = std::make_unique<PlanarRelativePose>(0);
  lidar.clone_slot = 0;
  ASSERT_EQ(filter.add_sensor(std::move(lidar)), 0);
  filter.gate.enabled = false;
  FilterState s;
  s.stamp_ns = 0;
  s.x(kSpeed) = 10.0;
  s.p.diagonal().head<kCoreStates>() << 25.0, 25.0, 16.0, 1.0, 0.25, 0.01, 0.01;
  s.clone(0);
  const double before = s.p(kYaw, kYaw);
  for (int i = 1; i <= 10; ++i) {  // 4 m/s straight ahead, all measured from the same anchor
    Measurement m;
    m.anchor_ns = 0;
    m.stamp_ns = i * 100 * test::kMillisecond;
    m.rows = 3;
    m.projection.setIdentity();
    m.value << 0.4 * i + 0.01 * normal(random), 0.01 * normal(random), 0.002 * normal(random);
    m.covariance = Eigen::Vector3d(1e-4, 1e-4, 4e-6).asDiagonal();
    filter.apply(s, m);
  }
  EXPECT_NEAR(s.x(kSpeed), 4.0, 0.3);
  EXPECT_NEAR(s.p(kYaw, kYaw) / before, 1.0, 0.01);
}

TEST(Correction, RandomUpdatesStayPositive) {
  test::stays_positive(100'000);
}

}  // namespace
}  // namespace adit::state_estimator
