#include "components/geometry/rigid.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace adit {
namespace {

TEST(IsRigid, TellsPosesFromWhatIsNone) {
  Pose pose = Pose::Identity();
  pose.linear() = so3_exp({0.3, -1.0, 2.0});
  pose.translation() << 1e5, -2.0, 3.0;
  EXPECT_TRUE(is_rigid(pose));
  pose.linear() = pose.linear().cast<float>().cast<double>();
  EXPECT_TRUE(is_rigid(pose));
  const auto spoiled = [&](int row, int column, double value) {
    Pose bad = pose;
    bad.matrix()(row, column) = value;
    return bad;
  };
  EXPECT_FALSE(is_rigid(spoiled(0, 3, std::nan(""))));
  EXPECT_FALSE(is_rigid(spoiled(1, 3, 1e8)));
  EXPECT_FALSE(is_rigid(spoiled(2, 2, std::numeric_limits<double>::infinity())));
  EXPECT_FALSE(is_rigid(spoiled(0, 0, pose.matrix()(0, 0) + 0.01)));
  Pose mirrored = pose;
  mirrored.linear().col(0) *= -1.0;
  EXPECT_FALSE(is_rigid(mirrored));
}

}  // namespace
}  // namespace adit
