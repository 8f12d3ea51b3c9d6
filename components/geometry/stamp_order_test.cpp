#include "components/geometry/stamp_order.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace adit {
namespace {

constexpr std::int64_t second = 1'000'000'000;

// Which of the stamps are taken.
std::vector<bool> taken(const std::vector<std::int64_t>& stamps) {
  StampOrder order(3, 1.0);
  std::optional<std::int64_t> last;
  std::vector<bool> out;
  for (const std::int64_t stamp : stamps) {
    out.push_back(order.accepts(stamp, last));
    if (out.back()) last = stamp;
  }
  return out;
}

TEST(StampOrder, LaterStampsAreTakenRepeatedAndEarlierOnesAreNot) {
  EXPECT_EQ(taken({-5, 3, 3, 2, 4}), (std::vector<bool>{true, true, false, false, true}));
}

TEST(StampOrder, AClockSetBackIsBelievedWhenStampsGoOnFromEachOther) {
  EXPECT_EQ(taken({9 * second, second, second + 1, second + 2, second + 3}),
            (std::vector<bool>{true, false, false, true, true}));
  EXPECT_EQ(taken({9 * second, second + 2, second + 1, second, second - 1}),
            (std::vector<bool>{true, false, false, false, false}));
}

TEST(StampOrder, AStampInOrderEndsTheRun) {
  EXPECT_EQ(taken({9 * second, second, second + 1, 10 * second, second + 2, second + 3}),
            (std::vector<bool>{true, false, false, true, false, false}));
}

TEST(StampOrder, WhatWasOvertakenIsLateHoweverManyComeInARow) {
  EXPECT_EQ(taken({2 * second, second, second + 1, second + 2, second + 3, second + 4}),
            (std::vector<bool>{true, false, false, false, false, false}));
}

}  // namespace
}  // namespace adit
