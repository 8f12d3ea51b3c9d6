#include "components/config/quantity.hpp"

#include <gmock/gmock.h>

#include <numbers>

#include "components/config/yaml_reader.hpp"

namespace adit {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Quantity, UnitsBecomeSi) {
  EXPECT_EQ(parse_quantity("36 km/h"), 36.0 / 3.6);
  EXPECT_EQ(parse_quantity("5 deg"), 5.0 * std::numbers::pi / 180.0);
  EXPECT_EQ(parse_quantity("100 us"), 100.0 * 1e-6);
  EXPECT_EQ(parse_quantity("-2.5ms"), -2.5 * 1e-3);
  EXPECT_EQ(parse_quantity("3 %"), 3.0 * 1e-2);
  EXPECT_EQ(parse_quantity("2 min"), 120.0);
  EXPECT_EQ(parse_quantity("1.5 km"), 1500.0);
  EXPECT_EQ(parse_quantity("7 cm"), 7.0 * 1e-2);
  EXPECT_EQ(parse_quantity("50 mK"), 50.0 * 1e-3);
  for (const char* text : {"4", "+4", "4.0", "4e0", "4 m", "4 s", "4 m/s", "4 rad", "4 Hz", "4 K"}) {
    EXPECT_EQ(parse_quantity(text), 4.0) << text;
  }
}

TEST(Quantity, RefusesAnythingElse) {
  for (const char* text :
       {"", " ", "km/h", "five", "36 mph", "36 KM/H", "36 km/h fast", "1e999", "inf", "nan", "4 ", "1,5"}) {
    EXPECT_FALSE(parse_quantity(text)) << text;
  }
}

TEST(Quantity, IsReadWithItsRange) {
  const auto document = YamlDocument::parse("speed: 36 km/h\nlist: [50 ms, 0.5]\n", "robot.yaml");
  ASSERT_TRUE(document);
  const YamlSection root = document->root();
  EXPECT_DOUBLE_EQ(root.quantity("speed", {}, {0.0, 20.0}), 10.0);
  EXPECT_EQ(root.quantity("absent", 3.0), 3.0);
  EXPECT_THAT(root.quantities("list", 2), ElementsAre(50.0 * 1e-3, 0.5));
  EXPECT_TRUE(root.quantities("absent", 2).empty());
  EXPECT_TRUE(root.ok());
  EXPECT_TRUE(document->finish()) << document->finish().error().message;
}

TEST(Quantity, ErrorsNameFileAndLineAndGiveTheDefault) {
  const auto document =
      YamlDocument::parse("a: 36 mph\nb: 90 km/h\nc: [1, 2]\nd: [1 s, 2, 3]\ne: [1, 20 km]\nf: 3\n", "robot.yaml");
  ASSERT_TRUE(document);
  const YamlSection root = document->root();
  EXPECT_EQ(root.quantity("a", 1.0), 1.0);
  EXPECT_FALSE(root.ok());
  EXPECT_EQ(root.quantity("b", 2.0, {0.0, 20.0}), 2.0);
  EXPECT_EQ(root.quantity("c", 3.0), 3.0);
  EXPECT_TRUE(root.quantities("d", 2).empty());
  EXPECT_TRUE(root.quantities("e", 2, {0.0, 100.0}).empty());
  EXPECT_TRUE(root.quantities("f", 1).empty());
  root.quantity("required");
  const Result<void> result = document->finish();
  ASSERT_FALSE(result);
  const std::string& message = result.error().message;
  EXPECT_THAT(message, HasSubstr("robot.yaml:1: 'a': expected a number, optionally with a unit (m, cm, km, s, "));
  EXPECT_THAT(message, HasSubstr("robot.yaml:2: 'b': '90 km/h' is not within [0, 20] in SI units"));
  EXPECT_THAT(message, HasSubstr("robot.yaml:3: 'c': expected a number"));
  EXPECT_THAT(message, HasSubstr("robot.yaml:4: 'd': expected a list of 2 numbers"));
  EXPECT_THAT(message, HasSubstr("robot.yaml:5: 'e': expected a list of 2 numbers within [0, 100]"));
  EXPECT_THAT(message, HasSubstr("robot.yaml:6: 'f': expected a list of 1 numbers"));
  EXPECT_THAT(message, HasSubstr("robot.yaml:1: 'required' is missing"));
}

}  // namespace
}  // namespace adit
