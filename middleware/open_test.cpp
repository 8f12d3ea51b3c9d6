#include <gmock/gmock.h>

#include <cstdlib>

#include "middleware/vendor.hpp"

namespace adit {
namespace {

using testing::HasSubstr;

Error refusal(const ParticipantConfig& config) {
  const auto participant = open(config);
  return participant ? Error{ErrorCode::internal, "opened"} : participant.error();
}

TEST(Open, UnknownVendorIsRefusedWithTheListOfThoseBuiltIn) {
  ParticipantConfig config;
  config.vendor = "carrier_pigeon";
  const Error error = refusal(config);
  EXPECT_EQ(error.code, ErrorCode::not_found);
  EXPECT_THAT(error.message, HasSubstr("'carrier_pigeon'"));
  for (const auto name : built_in_vendors()) EXPECT_THAT(error.message, HasSubstr(std::string(name)));
}

TEST(Open, VendorNotBuiltInSaysHowToBuildIt) {
  for (const std::string_view name : {"fastdds", "cyclonedds"}) {
    const auto all = built_in_vendors();
    if (std::find(all.begin(), all.end(), name) != all.end()) continue;
    const auto vendor = load_vendor(name);
    ASSERT_FALSE(vendor);
    EXPECT_EQ(vendor.error().code, ErrorCode::unavailable);
    EXPECT_THAT(vendor.error().message, HasSubstr("-DADIT_MIDDLEWARE=" + std::string(name)));
  }
}

TEST(Open, EveryVendorBuiltInLoadsAndIsTheOneAskedFor) {
  for (const auto name : built_in_vendors()) {
    const auto vendor = load_vendor(name);
    ASSERT_TRUE(vendor) << vendor.error().message;
    EXPECT_EQ((*vendor)->name, name);
    EXPECT_EQ(*load_vendor(name), *vendor);
  }
}

TEST(Open, DomainOutOfRangeIsRefused) {
  if (built_in_vendors().empty()) GTEST_SKIP() << "no vendor in this build";
  ParticipantConfig config;
  config.domain = 233;
  const Error error = refusal(config);
  EXPECT_EQ(error.code, ErrorCode::invalid_argument);
  EXPECT_THAT(error.message, HasSubstr("0 to 232"));
}

TEST(Open, TheEnvironmentNamesTheVendorUnlessTheConfigurationDoes) {
  setenv("ADIT_MIDDLEWARE", "nonesuch", 1);
  EXPECT_THAT(refusal({}).message, HasSubstr("'nonesuch'"));
  ParticipantConfig config;
  config.vendor = "other";
  EXPECT_THAT(refusal(config).message, HasSubstr("'other'"));
  unsetenv("ADIT_MIDDLEWARE");
}

TEST(Open, WarningsAreTheLinesThatSaySo) {
  EXPECT_EQ(warnings_in("a: b\nwarning: small buffers\n  warning   no memory\nno warning here\n"),
            (std::vector<std::string>{"small buffers", "no memory"}));
}

}  // namespace
}  // namespace adit
