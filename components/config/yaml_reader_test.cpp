#include "components/config/yaml_reader.hpp"

#include <gmock/gmock.h>

namespace adit {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

YamlDocument parse(const std::string& text) {
  Result<YamlDocument> document = YamlDocument::parse(text, "robot.yaml");
  EXPECT_TRUE(document) << document.error().message;
  return *document;
}

TEST(YamlReader, TypedValuesAndDefaults) {
  const YamlDocument document = parse(
      "name: lidar\nrange: 80\nretries: 3\non: true\nbackoff: 250ms\nlist: [1, 2.5]\nnested: {x: 1}\n"
      "items:\n  - {a: 1}\n  - {a: 2}\n");
  const YamlSection root = document.root();
  EXPECT_EQ(root.text("name"), "lidar");
  EXPECT_DOUBLE_EQ(root.number("range"), 80.0);
  EXPECT_EQ(root.integer("retries"), 3);
  EXPECT_TRUE(root.flag("on"));
  EXPECT_EQ(root.duration("backoff"), 250ms);
  EXPECT_EQ(root.duration("absent", 2s), 2s);
  EXPECT_THAT(root.numbers("list"), testing::ElementsAre(1.0, 2.5));
  EXPECT_EQ(root.section("nested").integer("x"), 1);
  EXPECT_EQ(root.section("not_there").integer("x", 7), 7);
  ASSERT_EQ(root.sections("items").size(), 2u);
  EXPECT_EQ(root.sections("items")[1].integer("a"), 2);
  (void)root.sections("items")[0].integer("a");
  EXPECT_TRUE(document.finish()) << document.finish().error().message;
}

TEST(YamlReader, ReportsEveryErrorWithFileAndLine) {
  const YamlDocument document = parse("range: far\nspeed: -1\ntypo: 3\nmode: fast\nwait: 5 parsecs\n");
  const YamlSection root = document.root();
  root.number("range", 1.0);
  root.number("speed", 1.0, {0.0, 10.0}, "m/s");
  root.choice("mode", {"paper", "default"});
  root.duration("wait", 1s);
  root.text("required");
  const Result<void> result = document.finish();
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, HasSubstr("robot.yaml:1: 'range' must be a number, not 'far'"));
  EXPECT_THAT(result.error().message, HasSubstr("robot.yaml:2: 'speed' must lie in [0, 10] m/s"));
  EXPECT_THAT(result.error().message, HasSubstr("robot.yaml:3: unknown key 'typo'; known here: mode, range"));
  EXPECT_THAT(result.error().message, HasSubstr("robot.yaml:4: 'mode' must be one of paper, default, not 'fast'"));
  EXPECT_THAT(result.error().message, HasSubstr("robot.yaml:5: 'wait' must be a duration"));
  EXPECT_THAT(result.error().message, HasSubstr("robot.yaml:1: 'required' is missing"));
}

TEST(YamlReader, ValuesKeepTheirYamlType) {
  const YamlDocument document =
      parse("a: 1\nb: 1.0\nc: true\nd: \"1\"\ne: [1, 2]\nf: [1, 2.5]\ng: [x, 1]\nh: {x: 1}\n");
  const YamlSection root = document.root();
  EXPECT_EQ(root.value("a"), YamlValue(std::int64_t{1}));
  EXPECT_EQ(root.value("b"), YamlValue(1.0));
  EXPECT_EQ(root.value("c"), YamlValue(true));
  EXPECT_EQ(root.value("d"), YamlValue(std::string("1")));
  EXPECT_EQ(root.value("e"), YamlValue(std::vector<std::int64_t>{1, 2}));
  EXPECT_EQ(root.value("f"), YamlValue(std::vector<double>{1.0, 2.5}));
  EXPECT_EQ(root.value("g"), YamlValue(std::vector<std::string>{"x", "1"}));
  EXPECT_FALSE(root.value("h"));
  EXPECT_FALSE(document.finish());
}

TEST(YamlReader, RefusesWhatIsNotAMapping) {
  for (const char* text : {"", "- 1\n- 2\n", "just text", "a: [1, 2", "a: 1\na: 2\n"}) {
    const Result<YamlDocument> document = YamlDocument::parse(text, "bad.yaml");
    if (!document) {
      EXPECT_THAT(document.error().message, testing::StartsWith("bad.yaml:")) << text;
      continue;
    }
    document->root().integer("a");
    EXPECT_FALSE(document->finish()) << text;
  }
  EXPECT_FALSE(YamlDocument::load("/nonexistent.yaml"));
}

}  // namespace
}  // namespace adit
