#include "components/state_estimator/monte_carlo.hpp"

#include <gtest/gtest.h>

#include <cstdio>

namespace adit::state_estimator::test {
namespace {

void print(const char* name, const MonteCarloResult& r) {
  std::printf(
      "%s: NEES %.2f, inside %.1f %%, pose %.2f, (v, w) %.2f, NIS/dof %.3f, autocorrelation %.4f, yaw rms %.2f "
      "deg, position rms %.1f m, %zu updates\n",
      name, r.nees_mean, 100.0 * r.inside, r.pose_nees_mean, r.motion_nees_mean, r.nis_per_dof,
      r.largest_autocorrelation, r.yaw_rms_deg, r.position_rms_m, r.updates);
}

TEST(MonteCarlo, ShortRunsAreConsistent) {
  for (const bool calibration : {false, true}) {
    MonteCarloConfig config;
    config.runs = 50;
    config.seconds = 40;
    config.calibration = calibration;
    const MonteCarloResult r = monte_carlo(config);
    print(calibration ? "9 states, 50 x 40 s" : "7 states, 50 x 40 s", r);
    EXPECT_GE(r.inside, 0.9);
    EXPECT_NEAR(r.nis_per_dof, 1.0, 0.03);
    EXPECT_NEAR(r.pose_nees_mean, 3.0, 0.7);
    EXPECT_NEAR(r.motion_nees_mean, 2.0, 0.3);
  }
}

}  // namespace
}  // namespace adit::state_estimator::test
