#include "components/dataset/pcd_file.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>

namespace adit::dataset {
namespace {

TEST(PcdFile, FieldsComeInTheStandardOrder) {
  const std::string path = testing::TempDir() + "adit_" + std::to_string(::getpid()) + ".pcd";
  std::ofstream(path)
      << "VERSION 0.7\nFIELDS ring t x y z intensity\nSIZE 2 4 4 4 4 4\nTYPE U U F F F F\nCOUNT 1 1 1 1 1 1\nWIDTH 2\n"
         "HEIGHT 1\nPOINTS 2\nDATA ascii\n5 1000000 1 2 3 9\n6 2000000 4 5 6 8\n";
  const Result<PointFile> cloud = read_pcd(path);
  ASSERT_TRUE(cloud) << cloud.error().message;
  EXPECT_THAT(cloud->fields, testing::ElementsAre("x", "y", "z", "intensity", "time", "ring"));
  EXPECT_THAT(cloud->values, testing::ElementsAre(1, 2, 3, 9, 0.001f, 5, 4, 5, 6, 8, 0.002f, 6));
  std::ofstream(path) << "nonsense";
  EXPECT_FALSE(read_pcd(path));
  std::remove(path.c_str());
}

}  // namespace
}  // namespace adit::dataset
