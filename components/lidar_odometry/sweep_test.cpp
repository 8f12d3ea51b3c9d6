#include "components/lidar_odometry/sweep.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "components/lidar_odometry/test_scene.hpp"

namespace adit::lidar_odometry {
namespace {

TEST(StridedView, ReadsFieldsOfAMessageInPlace) {
  struct Record {
    float x, y, z, intensity;
    std::uint16_t ring;
    std::uint32_t t;
  };
  const Record records[2] = {{1.0f, 2.0f, 3.0f, 9.0f, 7, 100}, {4.0f, 5.0f, 6.0f, 9.0f, 8, 200}};
  Cloud cloud;
  cloud.points = {&records[0].x, sizeof(Record), 2};
  cloud.rings = {&records[0].ring, sizeof(Record), 2};
  cloud.nanoseconds = {&records[0].t, sizeof(Record), 2};
  EXPECT_EQ(cloud.points[1], Point3f(4.0f, 5.0f, 6.0f));
  EXPECT_EQ(cloud.rings[1], 8);
  EXPECT_DOUBLE_EQ(point_time(cloud, 1), 200e-9);
  EXPECT_TRUE(consistent(cloud));
  cloud.height = 2;
  cloud.width = 2;
  EXPECT_FALSE(consistent(cloud));
}

TEST(TimeSpan, TakesEarliestAndLatestAndRefusesWhatIsNoTimeOfASweep) {
  RecordedSweep sweep;
  sweep.points.resize(3, Point3f(1.0f, 1.0f, 1.0f));
  EXPECT_FALSE(time_span(sweep.cloud()));
  sweep.seconds = {0.05f, -0.01f, 0.09f};
  const auto span = time_span(sweep.cloud());
  ASSERT_TRUE(span);
  EXPECT_FLOAT_EQ(static_cast<float>(span->first), -0.01f);
  EXPECT_FLOAT_EQ(static_cast<float>(span->last), 0.09f);
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 1e9f}) {
    sweep.seconds[1] = bad;
    EXPECT_FALSE(time_span(sweep.cloud()));
  }
}

TEST(SweepMotion, UndoesTheMotionOfASyntheticSweep) {
  Vector6d twist;
  twist << 20.0, 1.0, -0.5, 0.3, -0.2, 1.5;
  ScannerModel model;
  model.noise = 0.0;
  const RecordedSweep moving = scan(hall(), model, Pose::Identity(), twist, 0, 1);
  const SweepMotion motion(twist, {0.0, model.period}, model.period);
  int on_floor = 0;
  for (std::size_t i = 0; i < moving.points.size(); ++i) {
    if (!moving.points[i].allFinite()) continue;
    const Eigen::Vector3d p =
        motion.compensate(moving.points[i].cast<double>(), static_cast<double>(moving.seconds[i]));
    // Seen from the end pose each point lies on a surface again: the free floor is at -1.5 m.
    if (p.z() < -1.3 && std::abs(p.x()) < 6.5 && std::abs(p.y()) < 3.4) {
      EXPECT_NEAR(p.z(), -1.5, 1e-3);
      ++on_floor;
    }
  }
  EXPECT_GT(on_floor, 100);
}

TEST(SweepMotion, LeavesPointsAloneWithoutMotionOrDuration) {
  const Eigen::Vector3d p(1.0, 2.0, 3.0);
  EXPECT_EQ(SweepMotion().compensate(p, 0.05), p);
  EXPECT_EQ(SweepMotion(Vector6d::Ones(), {0.0, 0.0}, 0.0).compensate(p, 0.05), p);
  EXPECT_FALSE(SweepMotion(Vector6d::Zero(), {0.0, 0.1}, 0.1).moving());
}

TEST(ReadPoints, CountsWhatItDrops) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  constexpr float inf = std::numeric_limits<float>::infinity();
  RecordedSweep sweep;
  sweep.points = {{0, 0, 0}, {nan, 1, 1}, {1, inf, 1}, {0.1f, 0, 0}, {1, 2, 3}, {500, 0, 0}, {3e38f, 3e38f, 3e38f}};
  std::vector<Eigen::Vector3d> points;
  ScanCounters counters;
  read_points(sweep.cloud(), {}, 0.5, 100.0, points, counters);
  ASSERT_EQ(points.size(), 1u);
  EXPECT_EQ(points[0], Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(counters.points, 7u);
  EXPECT_EQ(counters.invalid, 3u);
  EXPECT_EQ(counters.out_of_range, 3u);
}

TEST(Downsample, KeepsTheFirstPointOfEachCellInOrder) {
  VoxelFilter filter;
  std::vector<Eigen::Vector3d> selected;
  downsample(std::vector<Eigen::Vector3d>{{0.9, 0, 0}, {0.1, 0, 0}, {-0.1, 0, 0}, {5, 5, 5}, {0.5, 0.5, 0.5}}, 1.0,
             filter, selected);
  ASSERT_EQ(selected.size(), 3u);
  EXPECT_EQ(selected[0].x(), 0.9);
  EXPECT_EQ(selected[1].x(), -0.1);
  EXPECT_EQ(selected[2].x(), 5.0);
}

}  // namespace
}  // namespace adit::lidar_odometry
