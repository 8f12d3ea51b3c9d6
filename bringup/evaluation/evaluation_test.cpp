#include "bringup/evaluation/evaluation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <numbers>

namespace adit::evaluation {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

StampedPose at(double t, double x, double y, double heading = 0.0) {
  StampedPose p;
  p.stamp_ns = std::llround(t * 1e9);
  p.pose.linear() = so3_exp({0.0, 0.0, heading});
  p.pose.translation() = Eigen::Vector3d(x, y, 0.0);
  return p;
}

// 1 m/s along x, a pose every 0.5 s for `length` metres.
Trajectory straight(double length, double speed_factor = 1.0, double heading = 0.0) {
  Trajectory path;
  for (int i = 0; 0.5 * i <= length; ++i) {
    const double s = 0.5 * i * speed_factor;
    path.push_back(at(0.5 * i, s * std::cos(heading), s * std::sin(heading), heading));
  }
  return path;
}

TEST(Evaluation, PerfectEstimateIsPerfect) {
  const Trajectory truth = straight(30.0);
  const Result<Evaluation> e = evaluate(truth, truth);
  ASSERT_TRUE(e) << e.error().message;
  EXPECT_NEAR(*e->ate_rmse_m, 0.0, 1e-12);
  EXPECT_NEAR(*e->rpe_10m_percent, 0.0, 1e-9);
  EXPECT_NEAR(*e->drift_percent, 0.0, 1e-9);
  EXPECT_NEAR(*e->yaw_end_deg, 0.0, 1e-9);
  EXPECT_NEAR(*e->scale, 1.0, 1e-12);
  EXPECT_DOUBLE_EQ(e->availability, 1.0);
  EXPECT_EQ(e->frames, 61u);
  EXPECT_DOUBLE_EQ(e->distance_m, 30.0);
  EXPECT_DOUBLE_EQ(e->truth_duration_s, 30.0);
}

TEST(Evaluation, ScaleErrorByHand) {
  // 10 % short on 20 m: error 0.1 s at path s, s = 0, 0.5 ... 20 (41 poses).
  const Result<Evaluation> e = evaluate(straight(20.0), straight(20.0, 0.9));
  ASSERT_TRUE(e);
  // rmse = 0.1 * 0.5 * sqrt(sum i^2 / 41), sum i^2 for i <= 40 is 22140.
  EXPECT_NEAR(*e->ate_rmse_m, 0.05 * std::sqrt(22140.0 / 41.0), 1e-12);
  EXPECT_NEAR(*e->ate_mean_m, 1.0, 1e-12);
  EXPECT_NEAR(*e->ate_median_m, 1.0, 1e-12);
  EXPECT_NEAR(*e->ate_max_m, 2.0, 1e-12);
  EXPECT_NEAR(*e->drift_percent, 10.0, 1e-9);
  EXPECT_NEAR(*e->rpe_10m_percent, 10.0, 1e-9);
  EXPECT_NEAR(*e->scale, 1.0 / 0.9, 1e-12);
  EXPECT_NEAR(*e->axial_end_m, -2.0, 1e-12);
  EXPECT_NEAR(*e->lateral_end_m, 0.0, 1e-12);
  for (const DriftByLength& row : e->drift) EXPECT_NEAR(row.translation_percent, 10.0, 1e-9) << row.length_m;
  ASSERT_EQ(e->drift.size(), 4u);  // 1, 5, 10, 20
  EXPECT_EQ(e->drift[2].segments, 21u);
  EXPECT_NEAR(e->drift[2].translation_rmse_m, 1.0, 1e-9);

  Options sim3;
  sim3.alignment = Alignment::sim3;
  const Result<Evaluation> aligned = evaluate(straight(20.0), straight(20.0, 0.9), sim3);
  ASSERT_TRUE(aligned);
  EXPECT_NEAR(*aligned->ate_rmse_m, 0.0, 1e-9);
  EXPECT_NEAR(*aligned->drift_percent, 10.0, 1e-9);  // drift stays what the vehicle experiences
}

TEST(Evaluation, YawDriftByHand) {
  // The estimate leaves at the right heading and turns away by 1 degree in the last metre of 10.
  Trajectory truth, estimate;
  const double degree = std::numbers::pi / 180.0;
  for (int i = 0; i <= 10; ++i) {
    truth.push_back(at(0.4 * i, i, 0));
    estimate.push_back(at(0.4 * i, i, i == 10 ? -0.1 : 0.0, i == 10 ? -degree : 0.0));
  }
  const Result<Evaluation> e = evaluate(truth, estimate);
  ASSERT_TRUE(e);
  EXPECT_NEAR(*e->yaw_end_deg, 1.0, 1e-9);
  EXPECT_NEAR(*e->lateral_end_m, -0.1, 1e-12);
  EXPECT_NEAR(*e->drift_percent, 1.0, 1e-9);
  EXPECT_NEAR(*e->rpe_10m_percent, 1.0, 1e-9);             // one segment
  EXPECT_NEAR(e->drift[0].rotation_deg_per_m, 0.1, 1e-9);  // ten 1 m segments, one of them 1 degree off
}

TEST(Evaluation, AlignmentRemovesTheFrame) {
  const Trajectory truth = straight(30.0);
  Trajectory estimate = straight(30.0, 1.0, 2.0);
  for (StampedPose& p : estimate) p.pose.translation() += Eigen::Vector3d(100, -50, 3);
  for (const Alignment a : {Alignment::first_pose, Alignment::se3, Alignment::sim3}) {
    for (const bool yaw_only : {false, true}) {
      const Result<Evaluation> e = evaluate(truth, estimate, {.alignment = a, .yaw_only = yaw_only, .lengths_m = {10}});
      ASSERT_TRUE(e);
      EXPECT_NEAR(*e->ate_max_m, 0.0, 1e-6) << to_string(a) << yaw_only;
    }
  }
  Options none;
  none.alignment = Alignment::none;
  const Result<Evaluation> raw = evaluate(truth, estimate, none);
  ASSERT_TRUE(raw);
  EXPECT_GT(*raw->ate_rmse_m, 50.0);
  EXPECT_NEAR(*raw->drift_percent, 0.0, 1e-6);
}

TEST(Evaluation, InterpolatesTheTruthBetweenItsPosesOnly) {
  const Trajectory truth = straight(10.0);
  Trajectory estimate;
  for (int i = -4; i < 60; ++i) estimate.push_back(at(0.25 * i + 0.1, 0.25 * i + 0.1, 0));
  const Result<Evaluation> e = evaluate(truth, estimate);
  ASSERT_TRUE(e);
  EXPECT_EQ(e->frames, 40u);  // 0.1 ... 9.85
  EXPECT_NEAR(*e->ate_max_m, 0.0, 1e-9);

  // A truth with a hole of 2 s is not interpolated across it; poses at its edges still pair within 10 ms.
  Trajectory holed = truth;
  holed.erase(holed.begin() + 5, holed.begin() + 8);  // 2.0 s to 4.0 s stay as edges
  const Result<Evaluation> h = evaluate(holed, estimate);
  ASSERT_TRUE(h);
  EXPECT_EQ(h->frames, 32u);
  Trajectory on_edge = {at(1.0, 1, 0), at(2.008, 2, 0), at(3.0, 3, 0), at(4.0, 4, 0)};
  EXPECT_EQ(evaluate(holed, on_edge)->frames, 3u);
}

TEST(Evaluation, SparseTruthPairsWithTheNearestPose) {
  Trajectory truth, estimate;
  for (int i = 0; i <= 4; ++i) truth.push_back(at(5.0 * i, i, 0));
  for (int i = 0; i <= 2000; ++i) estimate.push_back(at(0.01 * i + 0.004, 0.002 * i, 0));
  const Result<Evaluation> e = evaluate(truth, estimate);
  ASSERT_TRUE(e);
  EXPECT_EQ(e->frames, 5u);
}

TEST(Evaluation, AvailabilityCountsPausesAndLateStarts) {
  const Trajectory truth = straight(100.0);
  Trajectory estimate;
  for (int i = 0; i <= 1000; ++i) {
    const double t = 0.1 * i;
    if (t < 10.0 - 1e-9 || (t > 50.0 + 1e-9 && t < 60.0 - 1e-9)) continue;
    estimate.push_back(at(t, t, 0));
  }
  const Result<Evaluation> e = evaluate(truth, estimate);
  ASSERT_TRUE(e);
  EXPECT_NEAR(e->availability, 0.8, 1e-9);
  EXPECT_NEAR(e->largest_gap_s, 10.0, 1e-9);
}

TEST(Evaluation, DegenerateInputGivesErrorsOrNothingButNoNan) {
  const Trajectory truth = straight(20.0);
  const Trajectory empty;
  EXPECT_FALSE(evaluate(empty, truth));
  EXPECT_FALSE(evaluate(truth, empty));
  EXPECT_FALSE(evaluate({truth[0]}, truth));

  Trajectory elsewhere = truth;
  for (StampedPose& p : elsewhere) p.stamp_ns += 1000 * kSecond;
  const Result<Evaluation> apart = evaluate(truth, elsewhere);
  ASSERT_FALSE(apart);
  EXPECT_NE(apart.error().message.find("no common instant"), std::string::npos);

  Trajectory bad = truth;
  bad[3].pose.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(evaluate(truth, bad));
  EXPECT_FALSE(evaluate(bad, truth));
  Trajectory unordered = truth;
  std::swap(unordered[1].stamp_ns, unordered[2].stamp_ns);
  EXPECT_FALSE(evaluate(truth, unordered));

  const Result<Evaluation> one = evaluate(truth, {truth[4]});
  ASSERT_TRUE(one);
  EXPECT_EQ(one->frames, 1u);
  EXPECT_FALSE(one->drift_percent);
  EXPECT_FALSE(one->scale);
  EXPECT_FALSE(one->rpe_10m_percent);
  EXPECT_EQ(one->availability, 0.0);

  Trajectory standing;
  for (int i = 0; i < 20; ++i) standing.push_back(at(0.5 * i, 1.0, 2.0));
  const Result<Evaluation> still = evaluate(standing, truth);
  ASSERT_TRUE(still);
  EXPECT_FALSE(still->drift_percent);
  EXPECT_FALSE(still->scale);
  EXPECT_FALSE(still->rpe_10m_percent);
  EXPECT_TRUE(std::isfinite(*still->ate_rmse_m));
  Options sim3;
  sim3.alignment = Alignment::sim3;
  EXPECT_FALSE(evaluate(truth, standing, sim3));
}

// The stored odometry of the real set drifts 1.1 m and 5.9 degrees against the set's reference (its README).
TEST(Evaluation, RealTrajectoriesGiveTheKnownDrift) {
  const char* const shared = std::getenv("ADIT_SHARED");
  const std::filesystem::path folder =
      std::filesystem::path(shared ? shared : ADIT_SOURCE_DIR "/../shared") / "data" / "subt_anymal_vlp16";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "skipped: no shared data";
  const Result<Trajectory> truth = read_tum((folder / "ref_lidar.tum").string());
  const Result<Trajectory> estimate = read_tum((folder / "maplab_lidar.tum").string());
  ASSERT_TRUE(truth && estimate);
  const Result<Evaluation> e = evaluate(*truth, *estimate);
  ASSERT_TRUE(e) << e.error().message;
  EXPECT_EQ(e->frames, 24u);
  EXPECT_NEAR(*e->drift_percent / 100.0 * e->distance_m, 1.1, 0.1);  // at the end
  EXPECT_NEAR(*e->yaw_end_deg, 5.9, 0.1);
  EXPECT_NEAR(e->distance_m, 24.0, 1.5);
  std::printf("stored odometry: rmse %.3f m, max %.3f m, end %.2f %%, heading %.2f deg\n", *e->ate_rmse_m,
              *e->ate_max_m, *e->drift_percent, *e->yaw_end_deg);
}

}  // namespace
}  // namespace adit::evaluation
