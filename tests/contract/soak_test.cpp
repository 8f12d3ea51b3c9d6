// A minute of 4 MB clouds at 10 Hz with default settings: nothing lost, on every pair, best effort and reliable.
#include "tests/contract/load.hpp"

namespace adit::contract {
namespace {

class Soak : public Contract {};
INSTANTIATE_TEST_SUITE_P(Pairs, Soak, testing::ValuesIn(all_pairs()), name_of);

constexpr unsigned minute = 600;  // samples at 10 Hz

TEST_P(Soak, MinuteOf4MegabytesAt10HzBestEffort) {
  Link link(*this, GetParam(), Qos::sensor(), Qos::sensor());
  ASSERT_TRUE(link.reader && link.writer);
  expect_nothing_lost(run_load(link, cloud, minute, 10.0), minute,
                      GetParam().writer + " to " + GetParam().reader + ", 4 MB at 10 Hz, best effort");
}

TEST_P(Soak, MinuteOf4MegabytesAt10HzReliable) {
  Link link(*this, GetParam(), Qos::reliable(), Qos::reliable());
  ASSERT_TRUE(link.reader && link.writer);
  expect_nothing_lost(run_load(link, cloud, minute, 10.0), minute,
                      GetParam().writer + " to " + GetParam().reader + ", 4 MB at 10 Hz, reliable");
}

}  // namespace
}  // namespace adit::contract
