#include "components/lidar_odometry/point_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace adit::lidar_odometry {
namespace {

std::vector<Eigen::Vector3d> random_points(int count, const Eigen::Vector3d& centre, double spread, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> u(-spread, spread);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    // One statement a coordinate: the order in which arguments are evaluated is the compiler's choice.
    const double x = u(random);
    const double y = u(random);
    const double z = u(random);
    points.push_back(centre + Eigen::Vector3d(x, y, z));
  }
  return points;
}

TEST(PointMap, NearestIsTheBruteForceOneAlsoFarFromTheOrigin) {
  for (const Eigen::Vector3d& centre : {Eigen::Vector3d(0.0, 0.0, 0.0), Eigen::Vector3d(-1e4, 2e4, 300.0)}) {
    PointMap map(1.0, 1000, 0.0);
    const auto points = random_points(4000, centre, 6.0, 1);
    map.add(points);
    for (const Eigen::Vector3d& query : random_points(500, centre, 5.0, 2)) {
      double best = 1e9;
      for (const Eigen::Vector3d& point : points) best = std::min(best, (point - query).norm());
      const Neighbourhood near = map.nearest(query, 1.0);
      ASSERT_TRUE(near.found);
      EXPECT_NEAR(std::sqrt(near.distance2), best, 1e-5);
      EXPECT_NEAR((near.nearest - query).norm(), best, 1e-5);
    }
  }
}

TEST(PointMap, StatisticsAreThoseOfTheBlock) {
  PointMap map(0.5, 1000, 0.0);
  const auto points = random_points(3000, {500.0, -2.0, 0.0}, 3.0, 3);
  map.add(points);
  for (const Eigen::Vector3d& query : random_points(50, {500.0, -2.0, 0.0}, 2.0, 4)) {
    const Cell cell = cell_of(query, 2.0);
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    std::vector<Eigen::Vector3d> block;
    for (const Eigen::Vector3d& point : points) {
      if ((cell_of(point, 2.0) - cell).cwiseAbs().maxCoeff() <= 1) {
        block.push_back(point);
        mean += point;
      }
    }
    mean /= static_cast<double>(block.size());
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (const auto& point : block) covariance += (point - mean) * (point - mean).transpose();
    covariance /= static_cast<double>(block.size());
    const NeighbourhoodStatistics statistics = map.statistics(query, 0.5);
    EXPECT_EQ(statistics.count, static_cast<int>(block.size()));
    EXPECT_LT((statistics.covariance - covariance).norm(), 1e-5);
    EXPECT_EQ(statistics.found, map.nearest(query, 0.5).found);
  }
}

TEST(PointMap, HonoursGateCountAndSpacing) {
  PointMap map(1.0, 3, 0.3);
  map.add(std::vector<Eigen::Vector3d>{
      {0.1, 0.1, 0.1}, {0.2, 0.1, 0.1}, {0.5, 0.1, 0.1}, {0.9, 0.1, 0.1}, {0.9, 0.9, 0.9}});
  EXPECT_EQ(map.statistics({0.5, 0.5, 0.5}, 1.0).count, 3);  // the second is crowded, the last is too many
  EXPECT_FALSE(map.nearest({0.1, 0.6, 0.1}, 0.45).found);
  EXPECT_TRUE(map.nearest({0.1, 0.6, 0.1}, 0.55).found);
}

TEST(PointMap, RemovesWhatIsFarAndReusesItsCells) {
  PointMap map(0.5, 1, 0.0);
  std::size_t cells = 0;
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d centre(2.0 * i, 0.0, 0.0);
    map.add(random_points(500, centre, 4.0, static_cast<unsigned>(i)));
    map.add(std::vector<Eigen::Vector3d>{centre});
    map.remove_far(centre, 20.0);
    if (i == 150) cells = map.cells();
  }
  EXPECT_LT(map.cells(), cells + cells / 10);
  EXPECT_FALSE(map.nearest({0.0, 0.0, 0.0}, 0.5).found);
  // Its cell holds one point: this one or an earlier one, which is no farther than the cell's diagonal.
  EXPECT_TRUE(map.nearest({598.0, 0.0, 0.0}, 0.5 * std::sqrt(3.0)).found);
  map.clear();
  EXPECT_TRUE(map.empty());
  EXPECT_FALSE(map.nearest({598.0, 0.0, 0.0}, 0.5).found);
}

TEST(PointMap, IgnoresPointsBeyondItsGrid) {
  PointMap map(0.1, 1, 0.0);
  map.add(std::vector<Eigen::Vector3d>{{2e5, 0.0, 0.0}});
  EXPECT_TRUE(map.empty());
  EXPECT_FALSE(map.nearest({2e5, 0.0, 0.0}, 0.1).found);
}

}  // namespace
}  // namespace adit::lidar_odometry
