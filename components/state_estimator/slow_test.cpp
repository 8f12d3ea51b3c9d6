// Full-length studies of the specification's section 6, S0; label slow.
#include <gtest/gtest.h>

#include <cstdio>

#include "components/state_estimator/monte_carlo.hpp"

namespace adit::state_estimator::test {
namespace {

void study(bool calibration, bool diagonal) {
  MonteCarloConfig config;
  config.calibration = calibration;
  config.diagonal_noise = diagonal;
  const MonteCarloResult r = monte_carlo(config);
  std::printf(
      "%d states%s: NEES %.2f, %.1f %% of 600 s inside the band, pose %.2f, (v, w) %.2f, NIS/dof %.3f, "
      "autocorrelation %.4f, yaw rms %.2f deg, position rms %.1f m, %zu updates\n",
      calibration ? 9 : 7, diagonal ? ", diagonal noise" : "", r.nees_mean, 100.0 * r.inside, r.pose_nees_mean,
      r.motion_nees_mean, r.nis_per_dof, r.largest_autocorrelation, r.yaw_rms_deg, r.position_rms_m, r.updates);
  if (diagonal) return;  // for comparison only: known to be inconsistent
  EXPECT_GE(r.inside, 0.94);
  EXPECT_GE(r.nis_per_dof, 0.97);
  EXPECT_LE(r.nis_per_dof, 1.03);
}

TEST(S0, SevenStates) {
  study(false, false);
}
TEST(S0, NineStates) {
  study(true, false);
}
TEST(S0, SevenStatesWithThePapersDiagonalNoise) {
  study(false, true);
}

}  // namespace
}  // namespace adit::state_estimator::test
