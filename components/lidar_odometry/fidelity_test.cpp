// Modes kiss and genz against the trajectories of the published programs on the same 60 sweeps, and default against the
// truth. Nearest-point registration of a smooth tunnel is chaotic: a millimetre of noise moves the end of the published
// KISS-ICP method by metres, so single runs are compared while they agree, and ends by their median over noise.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

#include "components/lidar_odometry/lidar_odometry.hpp"
#include "components/lidar_odometry/test_data.hpp"

namespace adit::lidar_odometry {
namespace {

class Fidelity : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = shared_data("synthetic_lidar_64x512").value_or("");
    if (folder_.empty()) GTEST_SKIP() << "skipped: no shared data";
  }

  std::vector<Pose> poses(const std::string& name) const {
    std::vector<Pose> result;
    const Result<Trajectory> trajectory = read_tum(folder_ + "/" + name);
    EXPECT_TRUE(trajectory) << name;
    if (trajectory) {
      for (const StampedPose& p : *trajectory) result.push_back(p.pose);
    }
    return result;
  }

  // noise: m, added to each coordinate, uniform.
  std::vector<Pose> run(Mode mode, bool deskew, float noise = 0.0f, unsigned seed = 0) const {
    Config config;
    config.mode = mode;
    config.deskew = deskew;
    LidarOdometry odometry(config);
    std::mt19937 random(seed);
    const auto jitter = [&] { return noise * (static_cast<float>(random() >> 8) / 8388608.0f - 1.0f); };
    std::vector<Pose> result;
    for (RecordedSweep& sweep : read_sweeps(folder_)) {
      if (noise > 0.0f) {
        for (Point3f& point : sweep.points) {
          for (float& coordinate : point.reshaped()) coordinate += jitter();  // in this order on every compiler
        }
      }
      result.push_back(odometry.process(sweep.cloud()).pose);
    }
    return result;
  }

  // Root mean square difference of the distances travelled from sweep to sweep, over sweeps 1 to last.
  static double step_difference(const std::vector<Pose>& a, const std::vector<Pose>& b, std::size_t last) {
    double sum = 0.0;
    for (std::size_t k = 1; k <= last; ++k) {
      const double step_a = (a[k].translation() - a[k - 1].translation()).norm();
      const double step_b = (b[k].translation() - b[k - 1].translation()).norm();
      sum += (step_a - step_b) * (step_a - step_b);
    }
    return std::sqrt(sum / static_cast<double>(last));
  }

  static void within_a_quarter(const char* name, double ours, double published) {
    std::printf("  %-28s %8.3f published %8.3f\n", name, ours, published);
    EXPECT_GT(ours, 0.75 * published) << name;
    EXPECT_LT(ours, 1.25 * published) << name;
  }

  std::string folder_;
};

TEST_F(Fidelity, GenzDrivesAsPublished) {
  const std::vector<Pose> truth = poses("gt_mid.tum");
  for (const bool deskew : {false, true}) {
    const std::vector<Pose> published = poses(deskew ? "reference_genz_deskew.tum" : "reference_genz_raw.tum");
    const std::vector<Pose> ours = run(Mode::genz, deskew);
    const TrajectoryError a = trajectory_error(truth, ours);
    const TrajectoryError b = trajectory_error(truth, published);
    within_a_quarter(deskew ? "genz deskew end [%]" : "genz raw end [%]", a.end_percent, b.end_percent);
    within_a_quarter(deskew ? "genz deskew ATE [m]" : "genz raw ATE [m]", a.ate, b.ate);
    EXPECT_LT(step_difference(ours, published, 59), 0.10);
    EXPECT_LT(trajectory_error(published, ours).ate, 0.10);
  }
}

TEST_F(Fidelity, KissDrivesAsPublishedUntilChaosParts) {
  for (const bool deskew : {false, true}) {
    const std::vector<Pose> published = poses(deskew ? "reference_kiss_deskew.tum" : "reference_kiss_raw.tum");
    const std::vector<Pose> ours = run(Mode::kiss, deskew);
    const double difference = step_difference(ours, published, 35);
    std::printf("  kiss %s steps 1-35: rms difference %.3f m\n", deskew ? "deskew" : "raw", difference);
    EXPECT_LT(difference, 0.03);
  }
}

// After sweep 36 a millimetre of noise, or another processor's rounding, decides which minimum kiss falls into: ends
// from 3 to 20 % (deciles of 120 runs, median 8.66). So the published end, 8.43 %, is one draw of many: it has to be an
// ordinary one. A median of nine is within a quarter of it in two of three resamples only.
TEST_F(Fidelity, KissEndsAsPublishedInTheMedian) {
  const std::vector<Pose> truth = poses("gt_end.tum");
  constexpr std::size_t runs = 31;
  std::vector<double> ends;
  for (unsigned seed = 0; seed < runs; ++seed) {
    ends.push_back(trajectory_error(truth, run(Mode::kiss, true, 0.001f, seed)).end_percent);
  }
  std::sort(ends.begin(), ends.end());
  const double published = trajectory_error(truth, poses("reference_kiss_deskew.tum")).end_percent;
  std::printf("  kiss deskew end [%%], quartiles %.2f %.2f %.2f, published %.2f\n", ends[runs / 4], ends[runs / 2],
              ends[3 * runs / 4], published);
  EXPECT_LT(ends[runs / 4], published);
  EXPECT_GT(ends[3 * runs / 4], published);
}

// Issue: within 0.5 % and 0.05 m. Measured: 0.09 %, 0.014 m.
TEST_F(Fidelity, DefaultIsFarBetter) {
  const TrajectoryError error = trajectory_error(poses("gt_end.tum"), run(Mode::default_, true));
  EXPECT_LT(error.end_percent, 0.5);
  EXPECT_LT(error.ate, 0.05);
  EXPECT_LT(error.end_degrees, 0.2);
}

}  // namespace
}  // namespace adit::lidar_odometry
