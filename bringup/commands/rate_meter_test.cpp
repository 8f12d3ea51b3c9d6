#include "bringup/commands/rate_meter.hpp"

#include <gmock/gmock.h>

namespace adit {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

TEST(RateMeter, FiguresOfARegularStream) {
  RateMeter meter(100);
  for (int i = 0; i < 11; ++i) meter.add(Time(i * 100ms), 4'000'000, 2ms);
  EXPECT_THAT(meter.rate(), HasSubstr("average rate 10.000 Hz"));
  EXPECT_THAT(meter.rate(), HasSubstr("std 0.00000 s"));
  EXPECT_THAT(meter.bandwidth(), HasSubstr("40 MB/s"));
  EXPECT_THAT(meter.delay(), HasSubstr("delay mean 2.000 ms"));
}

TEST(RateMeter, WindowForgetsTheOldest) {
  RateMeter meter(3);
  meter.add(Time(0s), 1, {});
  for (int i = 10; i < 13; ++i) meter.add(Time(i * 1s), 1, {});
  EXPECT_EQ(meter.samples(), 3u);
  EXPECT_THAT(meter.rate(), HasSubstr("average rate 1.000 Hz"));
}

TEST(RateMeter, SaysWhatIsMissing) {
  RateMeter meter(10);
  EXPECT_THAT(meter.rate(), HasSubstr("fewer than two"));
  meter.add(Time(1s), 1, {});
  meter.add(Time(1s), 1, {});
  EXPECT_THAT(meter.rate(), HasSubstr("0.000 Hz"));
  EXPECT_THAT(meter.delay(), HasSubstr("no message with a stamp"));
}

}  // namespace
}  // namespace adit
