#include "components/lidar_odometry/voxel_table.hpp"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>

namespace adit::lidar_odometry {
namespace {

TEST(VoxelKeys, PackAndUnpackAreInverseUpToTheBorder) {
  const int edge = grid_half_width;
  for (const Cell& cell : {Cell(0, 0, 0), Cell(-1, -1, -1), Cell(1, -2, 3), Cell(-edge, edge - 1, -1),
                           Cell(edge - 1, -edge, edge - 1), Cell(-123456, 99999, -7)}) {
    ASSERT_TRUE(within_grid(cell));
    EXPECT_EQ(unpack(pack(cell)), cell);
  }
  EXPECT_FALSE(within_grid(Cell(edge, 0, 0)));
  EXPECT_FALSE(within_grid(Cell(0, -edge - 1, 0)));
}

TEST(VoxelKeys, CellsHaveOneSizeAlsoAroundZero) {
  EXPECT_EQ(cell_of(Eigen::Vector3d(-0.01, 0.01, -1.0), 1.0), Cell(-1, 0, -1));
  EXPECT_EQ(cell_of(Eigen::Vector3d(-1.01, 0.99, 1.0), 1.0), Cell(-2, 0, 1));
}

TEST(VoxelTable, AgreesWithStdMapOverRandomInsertsAndErases) {
  VoxelTable table;
  table.reserve(500);
  std::map<VoxelKey, VoxelTable::Index> truth;
  std::mt19937 random(1);
  for (int i = 0; i < 200000; ++i) {
    // Few different cells: long probe chains, many collisions with erased ones.
    const Cell cell(static_cast<int>(random() % 12) - 6, static_cast<int>(random() % 12) - 6,
                    static_cast<int>(random() % 6));
    const VoxelKey key = pack(cell);
    if (truth.contains(key)) {
      ASSERT_EQ(table.find(key), truth[key]);
      table.erase(key);
      truth.erase(key);
    } else if (truth.size() < table.capacity()) {
      ASSERT_EQ(table.find(key), VoxelTable::none);
      table.insert(key, static_cast<VoxelTable::Index>(i));
      truth[key] = static_cast<VoxelTable::Index>(i);
    }
    ASSERT_EQ(table.size(), truth.size());
  }
  for (const auto& [key, index] : truth) EXPECT_EQ(table.find(key), index);
}

TEST(VoxelTable, FindsItsWayWhenFull) {
  VoxelTable table;
  table.reserve(64);
  for (std::size_t i = 0; i < table.capacity(); ++i) table.insert(pack(Cell(static_cast<int>(i), 0, 0)), 1);
  EXPECT_EQ(table.find(pack(Cell(-5, 3, 9))), VoxelTable::none);
  table.clear();
  EXPECT_EQ(table.size(), 0u);
  EXPECT_EQ(table.find(pack(Cell(3, 0, 0))), VoxelTable::none);
}

TEST(VoxelFilter, IsASetThatEachPassStartsEmpty) {
  VoxelFilter filter;
  std::mt19937 random(2);
  for (int pass = 0; pass < 50; ++pass) {
    filter.begin(300);
    std::set<VoxelKey> seen;
    for (int i = 0; i < 300; ++i) {
      const VoxelKey key = pack(Cell(static_cast<int>(random() % 9), static_cast<int>(random() % 9), pass % 3));
      ASSERT_EQ(filter.first(key), seen.insert(key).second);
    }
  }
}

}  // namespace
}  // namespace adit::lidar_odometry
