#include "components/state_estimator/measurement_models.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "components/state_estimator/test_support.hpp"

namespace adit::state_estimator {
namespace {

FilterState somewhere() {
  FilterState s;
  s.stamp_ns = 100'000'000;
  s.x << 4.0, 2.0, 7.0, 0.5, 3.0, -0.2, 0.1, 0.08, 0.004, 0.06, 0.01, 0.05, 3.2, 1.4, -3.1, 1.0, 1.0, 0.3, 0.0, 0.0,
      0.0;
  s.clone_stamp_ns = {0, 0, kNoStamp};
  s.sensors[1].window.stamp_ns = s.sensors[1].last_accepted_ns = 50'000'000;
  return s;
}

TEST(MeasurementModels, JacobiansEqualCentralDifferences) {
  std::vector<std::unique_ptr<MeasurementModel>> models;
  models.push_back(std::make_unique<SpeedAndYawRate>());
  models.push_back(std::make_unique<SpeedAndYawRate>(OdometryCalibration{.scale = true, .yaw_bias = true}));
  models.push_back(std::make_unique<PlanarRelativePose>(0));
  models.push_back(std::make_unique<PlanarRelativePose>(1, OdometryCalibration{.scale = true, .yaw_bias = true}));
  const OdometryCalibration late{.scale = true, .yaw_bias = true, .delay = true};
  models.push_back(std::make_unique<SpeedAndYawRate>(late));
  models.push_back(std::make_unique<PlanarRelativePose>(0, late));
  models.push_back(std::make_unique<GyroYawRate>());
  models.push_back(std::make_unique<ImuYawRateAndAcceleration>(Eigen::Vector2d(0.4, -0.3)));
  models.push_back(std::make_unique<GnssPosition>(Eigen::Vector2d(0.4, -0.3)));
  models.push_back(std::make_unique<Speed>());
  models.push_back(std::make_unique<ZeroVelocity>());
  Measurement m;
  m.stamp_ns = 100'000'000;
  m.anchor_ns = 0;
  for (std::size_t k = 0; k < models.size(); ++k) {
    const Linearization l = models[k]->linearize(somewhere(), m);
    for (int i = 0; i < kStates; ++i) {
      FilterState plus = somewhere(), minus = somewhere();
      plus.x(i) += 1e-6;
      minus.x(i) -= 1e-6;
      Eigen::Vector3d numeric =
          -(models[k]->linearize(plus, m).innovation - models[k]->linearize(minus, m).innovation) / 2e-6;
      EXPECT_LT((numeric - l.jacobian.col(i)).norm(), 1e-6) << "model " << k << " state " << i;
    }
    for (int row = models[k]->size(); row < kMaxRows; ++row) EXPECT_EQ(l.jacobian.row(row).norm(), 0.0);
  }
}

TEST(MeasurementModels, RelativePoseAcrossTheWrap) {
  // From heading -3.1 to 3.0 the body turned by -0.183 rad, not by 6.1.
  Measurement m;
  m.stamp_ns = 100'000'000;
  m.anchor_ns = 0;
  m.value.z() = 3.0 + 3.1 - 2.0 * M_PI;
  EXPECT_NEAR(PlanarRelativePose(0).linearize(somewhere(), m).innovation.z(), 0.0, 1e-12);
}

TEST(MeasurementModels, ScaledRelativePose) {
  FilterState s = somewhere();
  s.x.segment<3>(clone_index(0)) << 0.0, 0.0, 0.0;
  s.x(kX) = 2.0;
  s.x(kY) = 0.0;
  s.x(kYaw) = 0.0;
  s.x(kScale) = std::log(0.9);
  Measurement m;
  m.stamp_ns = 100'000'000;
  m.anchor_ns = 0;
  m.value << 1.8, 0.0, 0.0004;
  const Linearization l = PlanarRelativePose(0, {.scale = true, .yaw_bias = true}).linearize(s, m);
  EXPECT_LT(l.innovation.norm(), 1e-12);
}

TEST(MeasurementModels, AnAccelerationThatMayBeNoiseSaysNothingOfTheDelay) {
  FilterState s = somewhere();
  Measurement m;
  m.stamp_ns = 100'000'000;
  m.anchor_ns = 0;
  const PlanarRelativePose model(0, {.delay = true});
  EXPECT_NEAR(model.linearize(s, m).jacobian.col(kThermalDelay).head<2>().norm(), 0.1 * 0.5, 1e-12);
  s.p(kAccel, kAccel) = 25.0;
  EXPECT_LT(model.linearize(s, m).jacobian.col(kThermalDelay).head<2>().norm(), 0.1 * 0.005);
}

}  // namespace
}  // namespace adit::state_estimator
