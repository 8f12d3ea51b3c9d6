#include "components/geometry/stamped_ring.hpp"

#include <gtest/gtest.h>

namespace adit {
namespace {

struct Sample {
  std::int64_t stamp_ns = 0;
};

constexpr std::int64_t second = 1'000'000'000;

TEST(StampedRing, KeepsTheNewestInOrder) {
  StampedRing<Sample> ring(3);
  EXPECT_TRUE(ring.empty());
  for (std::int64_t k = 1; k <= 5; ++k) ring.push({k});
  ASSERT_EQ(ring.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(ring[i].stamp_ns, static_cast<std::int64_t>(i) + 3);
  EXPECT_EQ(ring.newest().stamp_ns, 5);
  ring.clear();
  EXPECT_TRUE(ring.empty());
  ring.push({7});
  EXPECT_EQ(ring[0].stamp_ns, 7);
}

TEST(StampedRing, CoversWhatItReachesOverWithoutAGap) {
  StampedRing<Sample> ring(8);
  EXPECT_FALSE(ring.covers(0, second, 0, 10.0, 10.0));
  for (const std::int64_t k : {1, 2, 3, 6, 7}) ring.push({k * second});
  const auto covers = [&](std::int64_t from, std::int64_t to, std::size_t used) {
    return ring.covers(from * second, to * second, used, 0.5, 1.5);
  };
  EXPECT_TRUE(covers(1, 3, 5));
  EXPECT_TRUE(covers(6, 7, 5));
  EXPECT_FALSE(covers(2, 7, 5)) << "a gap of 3 s";
  EXPECT_FALSE(covers(4, 5, 5)) << "within the gap";
  EXPECT_FALSE(covers(0, 2, 5)) << "begins a second before the first";
  EXPECT_FALSE(covers(6, 8, 5)) << "ends a second after the last";
  EXPECT_FALSE(covers(2, 6, 3)) << "the fourth is not looked at";
  EXPECT_TRUE(ring.covers(second / 2, 3 * second, 5, 0.5, 1.5));
}

}  // namespace
}  // namespace adit
