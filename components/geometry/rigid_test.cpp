#include "components/geometry/rigid.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

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

TEST(PoseFromNumbers, IsTheInverseOfNumbersOf) {
  Pose pose = Pose::Identity();
  pose.linear() = so3_exp({0.3, -1.0, 2.0});
  pose.translation() << 1.0, -2.0, 3.0;
  const Result<Pose> back = pose_from_numbers(numbers_of(pose), "lidar_pose");
  ASSERT_TRUE(back);
  EXPECT_TRUE(back->isApprox(pose, 1e-14));
}

TEST(PoseFromNumbers, SaysWhatIsWrong) {
  const auto message = [](const std::vector<double>& numbers) {
    const Result<Pose> pose = pose_from_numbers(numbers, "lidar_pose");
    return pose ? std::string() : pose.error().message;
  };
  const std::string bad_values = "lidar_pose: not finite, or the quaternion's norm is not 1";
  EXPECT_EQ(message({1, 2, 3}), "lidar_pose: 7 numbers are wanted: x y z qx qy qz qw");
  EXPECT_EQ(message({}), "lidar_pose: 7 numbers are wanted: x y z qx qy qz qw");
  EXPECT_EQ(message({0, 0, std::nan(""), 0, 0, 0, 1}), bad_values);
  EXPECT_EQ(message({0, 0, 0, std::nan(""), 0, 0, 1}), bad_values);
  EXPECT_EQ(message({0, 0, 0, 0, 0, 0, 0}), bad_values);
  EXPECT_EQ(message({0, 0, 0, 0, 0, 0, 1.02}), bad_values);
  EXPECT_EQ(message({0, 0, 0, 0, 0, 0, 1.005}), "");
}

}  // namespace
}  // namespace adit
