#include "bringup/evaluation/alignment.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace adit::evaluation {
namespace {

Pose at(double x, double y, double z, double heading = 0.0) {
  Pose pose = Pose::Identity();
  pose.linear() = so3_exp({0.0, 0.0, heading});
  pose.translation() = Eigen::Vector3d(x, y, z);
  return pose;
}

// Truth on the unit cross, the estimate stretched to 1 along x and 2 along y: all sums can be done by hand.
// Covariance diag(1/2, 1, 0), variance of the estimate 5/2: rotation I, scale (1/2 + 1) / (5/2) = 3/5.
const std::vector<Pose> kCross = {at(1, 0, 0), at(0, 1, 0), at(-1, 0, 0), at(0, -1, 0)};
const std::vector<Pose> kStretched = {at(1, 0, 0), at(0, 2, 0), at(-1, 0, 0), at(0, -2, 0)};

TEST(Alignment, UmeyamaByHand) {
  const Result<Similarity> s = align(kCross, kStretched, Alignment::sim3, false);
  ASSERT_TRUE(s) << s.error().message;
  EXPECT_NEAR(s->scale, 0.6, 1e-12);
  EXPECT_LT((s->rotation - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  EXPECT_LT(s->translation.norm(), 1e-12);
  EXPECT_NEAR(*similarity_scale(kCross, kStretched), 0.6, 1e-12);
  const Result<Similarity> rigid = align(kCross, kStretched, Alignment::se3, false);
  ASSERT_TRUE(rigid);
  EXPECT_DOUBLE_EQ(rigid->scale, 1.0);
}

TEST(Alignment, RecoversAKnownSimilarityIncludingReflectionTraps) {
  const Eigen::Matrix3d rotation = so3_exp({0.4, -1.1, 2.0});
  const Eigen::Vector3d shift(3.0, -7.0, 0.5);
  std::vector<Pose> truth, estimate;
  for (int i = 0; i < 20; ++i) {
    const Pose e = at(std::cos(0.7 * i) * i, std::sin(0.9 * i), 0.0, 0.1 * i);  // planar: determinant of C is zero
    Pose t = Pose::Identity();
    t.linear() = rotation * e.linear();
    t.translation() = 2.5 * (rotation * e.translation()) + shift;
    estimate.push_back(e);
    truth.push_back(t);
  }
  const Result<Similarity> s = align(truth, estimate, Alignment::sim3, false);
  ASSERT_TRUE(s);
  EXPECT_NEAR(s->scale, 2.5, 1e-12);
  EXPECT_LT((s->rotation - rotation).norm(), 1e-9);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    EXPECT_LT((s->apply(estimate[i]).matrix() - truth[i].matrix()).norm(), 1e-8);
  }
}

TEST(Alignment, FirstPoseMatchesTheFirstPoseExactly) {
  const std::vector<Pose> truth = {at(1, 2, 3, 0.5), at(2, 2, 3)};
  const std::vector<Pose> estimate = {at(-1, 0, 0, -0.3), at(0, 0, 0)};
  const Result<Similarity> s = align(truth, estimate, Alignment::first_pose, false);
  ASSERT_TRUE(s);
  EXPECT_LT((s->apply(estimate[0]).matrix() - truth[0].matrix()).norm(), 1e-12);
}

TEST(Alignment, YawOnlyKeepsGravity) {
  // The estimate's frame is turned by 0.7 rad about z; its first pose is also tilted by mistake.
  std::vector<Pose> truth, estimate;
  for (int i = 0; i < 10; ++i) {
    truth.push_back(at(i, 0.1 * i * i, 0.2 * i, 0.1 * i));
    estimate.push_back(at(0, 0, 0, -0.7) * truth.back());
  }
  estimate[0].linear() = estimate[0].linear() * so3_exp({0.0, 0.05, 0.0});
  const Eigen::Matrix3d expected = so3_exp({0.0, 0.0, 0.7});
  for (const Alignment a : {Alignment::first_pose, Alignment::se3, Alignment::sim3}) {
    const Result<Similarity> s = align(truth, estimate, a, true);
    ASSERT_TRUE(s);
    EXPECT_LT((s->rotation - expected).norm(), 1e-3) << to_string(a);
    EXPECT_NEAR(s->rotation(2, 2), 1.0, 1e-12) << to_string(a);
  }
}

TEST(Alignment, AStraightLineTakesItsRollFromTheOrientations) {
  const Eigen::Matrix3d rotation = so3_exp({0.9, 0.2, -0.4});
  std::vector<Pose> truth, estimate;
  for (int i = 0; i < 10; ++i) {
    estimate.push_back(at(i, 0, 0));
    Pose t = Pose::Identity();
    t.linear() = rotation;
    t.translation() = rotation * estimate.back().translation();
    truth.push_back(t);
  }
  const Result<Similarity> s = align(truth, estimate, Alignment::se3, false);
  ASSERT_TRUE(s);
  EXPECT_LT((s->rotation - rotation).norm(), 1e-6);
}

TEST(Alignment, StandingStill) {
  const std::vector<Pose> truth = {at(5, 0, 0, 1.0), at(5, 0, 0, 1.0)};
  const std::vector<Pose> estimate = {at(0, 0, 0), at(0, 0, 0)};
  const Result<Similarity> rigid = align(truth, estimate, Alignment::se3, false);
  ASSERT_TRUE(rigid);
  EXPECT_LT((rigid->apply(estimate[1]).matrix() - truth[1].matrix()).norm(), 1e-9);
  EXPECT_FALSE(align(truth, estimate, Alignment::sim3, false));
  EXPECT_FALSE(similarity_scale(truth, estimate));
  EXPECT_FALSE(align({}, {}, Alignment::se3, false));
}

TEST(Alignment, NamesRoundTrip) {
  for (const Alignment a : {Alignment::none, Alignment::first_pose, Alignment::se3, Alignment::sim3}) {
    EXPECT_EQ(*parse_alignment(to_string(a)), a);
  }
  EXPECT_FALSE(parse_alignment("SE3"));
}

}  // namespace
}  // namespace adit::evaluation
