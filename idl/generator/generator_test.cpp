// The back end as idlc runs it: what it refuses, with file and line, and what it makes of a new .idl file.
#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "idl/generator/ros_type.hpp"
#include "idl/generator/sha256.hpp"

namespace adit::generator {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class Generator : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / (std::string("adit_generator_") + test->name() + std::to_string(getpid()));
    fs::create_directories(folder_ / "pkg" / "msg");
  }
  void TearDown() override { fs::remove_all(folder_); }

  struct Outcome {
    int exit_code;
    std::string output;
  };
  // Runs idlc on pkg/msg/<name>.idl with `text` in it.
  Outcome compile(const std::string& text, const std::string& name = "Type") const {
    const fs::path file = folder_ / "pkg" / "msg" / (name + ".idl");
    std::ofstream(file) << text;
    const std::string command = std::string(ADIT_IDLC) + " -l " ADIT_BACKEND " -f case-sensitive -x final -I " +
                                folder_.string() + " -o " + folder_.string() + " " + file.string() + " 2>&1";
    FILE* pipe = popen(command.c_str(), "r");
    std::string output;
    for (int c; (c = std::fgetc(pipe)) != EOF;) output += static_cast<char>(c);
    return {WEXITSTATUS(pclose(pipe)), output};
  }
  // The same with the members of a struct pkg::msg::Type, the first of them on line 2.
  Outcome compile_members(const std::string& members) const {
    return compile("module pkg { module msg { struct Type {\n" + members + "\n}; }; };\n");
  }
  std::string generated(const std::string& file) const {
    std::ifstream stream(folder_ / "pkg" / "msg" / file);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  fs::path folder_;
};

TEST_F(Generator, RefusesWhatCppCannotHoldWithFileAndLine) {
  const auto refused = [this](const std::string& members, const std::string& reason) {
    const Outcome outcome = compile_members(members);
    EXPECT_NE(outcome.exit_code, 0) << members;
    EXPECT_THAT(outcome.output, AllOf(HasSubstr("Type.idl:2:"), HasSubstr(reason))) << members;
    EXPECT_FALSE(fs::exists(folder_ / "pkg" / "msg" / "type.hpp")) << members;
  };
  refused("char c;", "use uint8");
  refused("long double x;", "not supported");
  refused("wchar c;", "");
  refused("wstring text;", "");
  refused("any x;", "");
  refused("map<string, double> x;", "");
  refused("sequence<sequence<double> > x;", "sequence of sequences");
  refused("sequence<double> x[3];", "array of sequences");
  refused("double x[3][4];", "one dimension");
  refused("@key uint8 x;", "@key");
  refused("@optional uint8 x;", "@optional");
  refused("@default (value=\"a\") uint8 x;", "");
}

TEST_F(Generator, RefusesOtherDefinitions) {
  const auto refused = [this](const std::string& text, const std::string& reason) {
    const Outcome outcome = compile(text);
    EXPECT_NE(outcome.exit_code, 0) << text;
    EXPECT_THAT(outcome.output, AllOf(HasSubstr("Type.idl:"), HasSubstr(reason))) << text;
  };
  const std::string member = "struct Type { uint8 x; };";
  refused("module pkg { module msg { enum E { A, B }; " + member + " }; };", "enum is not supported");
  refused("module pkg { module msg { union U switch(long) { case 1: long a; }; " + member + " }; };", "not supported");
  refused("module pkg { module msg { struct Type; struct A { sequence<Type> x; }; " + member + " }; };",
          "not supported");
  refused("module pkg { " + member + " };", "two modules");
  refused("module pkg { module msg { const uint8 A = 1; " + member + " }; };", "_Constants");
  refused("module pkg { module msg { module No_Constants { const uint8 A = 1; }; " + member + " }; };", "no struct");
  refused("module pkg { module msg { const uint8 A = 1; }; };", "");
  refused("module pkg { module msg { struct Type { uint8 x } }; };", "syntax error");
}

TEST_F(Generator, NewFileBecomesCpp) {
  const Outcome other = compile("module pkg { module msg { struct Other { double x; }; }; };\n", "Other");
  EXPECT_EQ(other.exit_code, 0) << other.output;
  const Outcome outcome = compile(
      "#include \"pkg/msg/Other.idl\"\n"
      "module pkg { module msg {\n"
      "  typedef float Triple[3];\n"
      "  module Type_Constants { const int64 LOWEST = -9223372036854775808; const string NAME = \"a\\\"b\";\n"
      "    const float HALF = 0.5; const boolean YES = TRUE; const uint64 MOST = 18446744073709551615; };\n"
      "  struct Type {\n"
      "    @default (value=-3) int16 number;\n"
      "    @default (value=2) double two;\n"
      "    @default (value=\"text\") string text;\n"
      "    @default (value=TRUE) boolean flag;\n"
      "    Triple triple;\n"
      "    sequence<pkg::msg::Other> others;\n"
      "    sequence<uint8> data;\n"
      "    sequence<string, 4> few;\n"
      "    uint8 class;\n"
      "  };\n"
      "}; };\n");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  const std::string header = generated("type.hpp");
  for (const char* line :
       {"#include \"pkg/msg/other.hpp\"", "namespace adit::pkg::msg {",
        "static constexpr std::int64_t LOWEST = (-9223372036854775807 - 1);",
        "static constexpr std::string_view NAME = \"a\\\"b\";", "static constexpr float HALF = 0.5f;",
        "static constexpr bool YES = true;", "static constexpr std::uint64_t MOST = 18446744073709551615u;",
        "std::int16_t number = -3;", "double two = 2.0;", "std::string text = \"text\";", "bool flag = true;",
        "std::array<float, 3> triple{};", "std::vector<::adit::pkg::msg::Other> others;", "::adit::Blob data;",
        "::adit::BoundedVector<std::string, 4> few;", "std::uint8_t class_ = 0;",
        "visit(\"class\", message.class_);"}) {
    EXPECT_THAT(header, HasSubstr(line));
  }
  EXPECT_THAT(generated("type.cpp"), AllOf(HasSubstr("\"pkg/msg/Type\""), HasSubstr("string text \"text\"\n"),
                                           HasSubstr("float32[3] triple\n"), HasSubstr("string[<=4] few\n"),
                                           HasSubstr("MSG: pkg/Other\nfloat64 x\n")));
  EXPECT_THAT(generated("type.d"), HasSubstr("Other.idl"));
}

TEST(Sha256, KnownAnswers) {
  EXPECT_EQ(sha256_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_hex("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
}

TEST(SnakeCase, FollowsRosidl) {
  EXPECT_EQ(snake_case("PointCloud2"), "point_cloud2");
  EXPECT_EQ(snake_case("TFMessage"), "tf_message");
  EXPECT_EQ(snake_case("NavSatFix"), "nav_sat_fix");
  EXPECT_EQ(snake_case("Pose2D"), "pose2_d");
  EXPECT_EQ(snake_case("ColorRGBA"), "color_rgba");
  EXPECT_EQ(snake_case("UInt32"), "u_int32");
  EXPECT_EQ(snake_case("String"), "string");
}

}  // namespace
}  // namespace adit::generator
