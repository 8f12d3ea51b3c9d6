#include <gmock/gmock.h>

#include "components/dataset/pcd_file.hpp"

namespace adit::dataset {
namespace {

TEST(PcdFile, BoardsRefuseItAndSayWhatToDo) {
  const Result<PointFile> cloud = read_pcd("cloud.pcd");
  ASSERT_FALSE(cloud);
  EXPECT_THAT(cloud.error().message, testing::HasSubstr("convert it to .bin"));
}

}  // namespace
}  // namespace adit::dataset
