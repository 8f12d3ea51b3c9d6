// The component under bad input of every kind between good frames. ADIT_FUZZ_FRAMES and ADIT_FUZZ_SEED say how many and
// which.
#include <gtest/gtest.h>

#include <cstdlib>

#include "components/thermal_odometry/fuzzed_component_drive.hpp"

namespace adit::thermal_odometry {
namespace {

int setting(const char* name, int fallback) {
  const char* value = std::getenv(name);
  return value != nullptr ? std::atoi(value) : fallback;
}

TEST(ThermalOdometryFuzz, SurvivesAndTracksAgain) {
  const auto figures = run_fuzzed_component_drive(setting("ADIT_FUZZ_FRAMES", ADIT_FUZZ_DEFAULT_FRAMES),
                                                  static_cast<std::uint32_t>(setting("ADIT_FUZZ_SEED", 1)));
  ASSERT_TRUE(figures) << figures.error().message;
  print(*figures);
  EXPECT_EQ(figures->not_finite, 0);
  EXPECT_EQ(figures->false_motion, 0);
  // At 160 x 128 pixels an alignment with all but lost depth may find a wrong minimum: rarer than one in a thousand.
  EXPECT_LE(figures->measured_wrong, figures->good_measured / 1000);
  EXPECT_GT(figures->good_measured, figures->good * 9 / 10);
  // The good stretches last 25 frames or more; the last one may be cut off.
  int unrecovered = 0;
  for (int i = 0; i < fault_count; ++i) {
    const auto& fault = figures->faults[static_cast<std::size_t>(i)];
    EXPECT_LE(fault.longest, 15) << to_string(static_cast<Fault>(i));
    unrecovered += fault.episodes - fault.recovered;
  }
  EXPECT_LE(unrecovered, 1);
}

}  // namespace
}  // namespace adit::thermal_odometry
