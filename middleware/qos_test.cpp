#include "middleware/qos.hpp"

#include <gmock/gmock.h>

namespace adit {
namespace {

using std::chrono::milliseconds;

std::vector<std::string> policies(const std::vector<Mismatch>& mismatches) {
  std::vector<std::string> names;
  for (const Mismatch& m : mismatches) names.push_back(m.policy);
  return names;
}

TEST(Qos, EqualProfilesMatch) {
  for (const Qos& qos : {Qos::sensor(), Qos::reliable(), Qos::latched(), Qos::clock(), Qos::rosout(), Qos::tf()}) {
    EXPECT_THAT(check(qos, qos), testing::IsEmpty()) << to_string(qos);
    EXPECT_TRUE(validate(qos));
  }
}

TEST(Qos, StrongerOfferMatchesWeakerRequest) {
  EXPECT_THAT(check(Qos::latched(), Qos::sensor()), testing::IsEmpty());
}

TEST(Qos, EveryFailingPolicyIsNamedWithBothValues) {
  Qos offered = Qos::sensor();
  offered.deadline = milliseconds(200);
  Qos requested = Qos::latched();
  requested.deadline = milliseconds(100);
  requested.lease = milliseconds(50);
  requested.liveliness = Qos::Liveliness::manual_by_topic;
  const std::vector<Mismatch> found = check(offered, requested);
  EXPECT_THAT(policies(found),
              testing::ElementsAre("reliability", "durability", "deadline", "liveliness", "liveliness lease"));
  EXPECT_EQ(found[0].offered, "best effort");
  EXPECT_EQ(found[0].requested, "reliable");
  EXPECT_EQ(found[2].offered, "200 ms");
  EXPECT_EQ(found[4].offered, "infinite");
  for (const Mismatch& m : found) EXPECT_FALSE(m.remedy.empty());
}

TEST(Qos, RefusesValuesNoVendorCanHonour) {
  Qos qos;
  qos.deadline = Duration::zero();
  EXPECT_FALSE(validate(qos));
  qos = Qos();
  qos.max_blocking = milliseconds(-1);
  EXPECT_FALSE(validate(qos));
}

TEST(Qos, TextNamesWhatDiffersFromTheDefaults) {
  EXPECT_EQ(to_string(Qos::sensor()), "best effort, volatile, keep last 5");
  EXPECT_EQ(to_string(Qos::rosout()), "reliable, transient local, keep last 1000, lifespan 10000 ms");
}

}  // namespace
}  // namespace adit
