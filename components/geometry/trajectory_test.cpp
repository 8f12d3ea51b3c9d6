#include "components/geometry/trajectory.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>

namespace adit {
namespace {

class TumFile : public testing::Test {
 protected:
  std::string path() const {
    return (std::filesystem::temp_directory_path() /
            (std::string("adit_") + testing::UnitTest::GetInstance()->current_test_info()->name() + ".tum"))
        .string();
  }
  std::string write(const std::string& text) const {
    std::ofstream(path()) << text;
    return path();
  }
  void TearDown() override { std::filesystem::remove(path()); }
};

TEST_F(TumFile, RoundTripKeepsNanosecondsAndPoses) {
  Trajectory out;
  for (int i = 0; i < 5; ++i) {
    Vector6d xi;
    xi << 0.1 * i, -0.2, 0.3, 0.01 * i, 0.02, -0.5;
    out.push_back({1'582'229'001'123'456'789 + i, se3_exp(xi)});
  }
  ASSERT_TRUE(write_tum(path(), out));
  const Result<Trajectory> in = read_tum(path());
  ASSERT_TRUE(in) << in.error().message;
  ASSERT_EQ(in->size(), out.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    EXPECT_EQ((*in)[i].stamp_ns, out[i].stamp_ns);
    EXPECT_LT(((*in)[i].pose.matrix() - out[i].pose.matrix()).norm(), 1e-8);
  }
}

TEST_F(TumFile, ReadsExponentsShortFractionsAndComments) {
  const Result<Trajectory> in = read_tum(write("# stamp ...\n\n1.5 0 0 0 0 0 0 1\n2.5e0 1 2 3 0 0 0 1\n"));
  ASSERT_TRUE(in) << in.error().message;
  ASSERT_EQ(in->size(), 2u);
  EXPECT_EQ((*in)[0].stamp_ns, 1'500'000'000);
  EXPECT_EQ((*in)[1].stamp_ns, 2'500'000'000);
  EXPECT_DOUBLE_EQ(path_length(*in), std::sqrt(14.0));
}

TEST_F(TumFile, NamesTheLineOfWhatIsWrong) {
  const char* const bad[] = {"1 0 0 0 0 0 0\n", "1 0 0 nan 0 0 0 1\n", "x 0 0 0 0 0 0 1\n", "1 0 0 0 0 0 0 2\n",
                             "1 0 0 0 0 0 0 1 9\n"};
  for (const char* text : bad) {
    const Result<Trajectory> in = read_tum(write(std::string("0 0 0 0 0 0 0 1\n") + text));
    ASSERT_FALSE(in) << text;
    EXPECT_NE(in.error().message.find(":2:"), std::string::npos) << in.error().message;
  }
  EXPECT_FALSE(read_tum(write("2 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n")));
  EXPECT_FALSE(read_tum("/nonexistent.tum"));
}

TEST(Trajectory, InterpolatesInsideAndRefusesOutside) {
  Trajectory path(2);
  path[0].stamp_ns = 100;
  path[1].stamp_ns = 200;
  path[1].pose.translation().x() = 1.0;
  EXPECT_NEAR(interpolate(path, 125)->translation().x(), 0.25, 1e-12);
  EXPECT_NEAR(interpolate(path, 200)->translation().x(), 1.0, 1e-12);
  EXPECT_FALSE(interpolate(path, 99));
  EXPECT_FALSE(interpolate(path, 201));
}

}  // namespace
}  // namespace adit
