#include "components/dataset/dataset.hpp"

#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "components/dataset/cloud_folder.hpp"
#include "components/dataset/png16.hpp"
#include "components/dataset/png8.hpp"
#include "components/dataset/point_file.hpp"

namespace adit::dataset {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class DatasetTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::temp_directory_path() / ("adit_dataset_" + std::to_string(::getpid()) + "_" +
                                         testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(root_ / "scans");
    fs::create_directories(root_ / "images");
  }
  void TearDown() override { fs::remove_all(root_); }
  std::string path(const std::string& name) const { return (root_ / name).string(); }
  void write(const std::string& name, const std::string& text) const { std::ofstream(root_ / name) << text; }

  fs::path root_;
};

TEST_F(DatasetTest, BinRoundTripWithTheIndexGivingTheColumns) {
  PointFile cloud;
  cloud.fields = standard_fields(5);
  cloud.points = 3;
  for (int i = 0; i < 15; ++i) cloud.values.push_back(0.5f * static_cast<float>(i));
  ASSERT_TRUE(write_bin(path("scans/a.bin"), cloud));
  write("scans/index.txt", "# file timestamp_ns n_points\na.bin 1582234630583380222 3\n");
  const Result<Dataset> dataset = open_dataset(root_.string(), 10.0);
  ASSERT_TRUE(dataset) << dataset.error().message;
  ASSERT_EQ(dataset->entries.size(), 1u);
  EXPECT_EQ(dataset->entries[0].stamp_ns, 1582234630583380222);
  const Result<PointFile> read = read_bin(dataset->entries[0].path, dataset->entries[0].points);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->fields, cloud.fields);
  EXPECT_EQ(read->values, cloud.values);
}

TEST_F(DatasetTest, BinOfTheWrongSizeIsRefused) {
  write("scans/a.bin", std::string(50, 'x'));
  EXPECT_FALSE(read_bin(path("scans/a.bin"), 3));
  EXPECT_FALSE(read_bin(path("scans/a.bin"), 0));
  write("scans/b.bin", "");
  EXPECT_THAT(read_bin(path("scans/b.bin"), 0).error().message, HasSubstr("empty"));
  EXPECT_FALSE(read_bin(path("scans/absent.bin"), 0));
}

TEST_F(DatasetTest, UnitsOfTheIndex) {
  write("scans/a.bin", std::string(16, 'x'));
  write("scans/b.bin", std::string(16, 'x'));
  write("scans/index.txt", "# file sensor_time_us n_points\na.bin 2666234430 1\nb.bin 2666334405 1\n");
  EXPECT_EQ(open_dataset(root_.string(), 10.0)->entries[1].stamp_ns, 2666334405000);
  write("scans/index.txt", "# file n_points\na.bin 1\nb.bin 1\n");
  const Result<Dataset> unstamped = open_dataset(root_.string(), 10.0);
  ASSERT_TRUE(unstamped) << unstamped.error().message;
  EXPECT_EQ(unstamped->entries[1].stamp_ns, 100'000'000);
}

TEST_F(DatasetTest, IndexErrorsNameFileAndLine) {
  write("scans/a.bin", std::string(16, 'x'));
  for (const char* bad : {"missing.bin 5 1\n", "a.bin later 1\n", "a.bin\n", "a.bin 5 many\n", "a.bin -5 1\n"}) {
    write("scans/index.txt", std::string("a.bin 3 1\n") + bad);
    const Result<Dataset> dataset = open_dataset(root_.string(), 10.0);
    ASSERT_FALSE(dataset) << bad;
    EXPECT_THAT(dataset.error().message, HasSubstr("index.txt:2:")) << bad;
  }
  EXPECT_FALSE(open_dataset("/nonexistent", 10.0));
  fs::remove_all(root_ / "scans");
  EXPECT_THAT(open_dataset(root_.string(), 10.0).error().message, HasSubstr("no data"));
}

TEST_F(DatasetTest, ImagesByNumberWithSecondsKeepEveryBit) {
  Image16 image{3, 2, {0, 1, 255, 256, 65535, 6000}};
  ASSERT_TRUE(write_png16(path("images/000007.png"), image));
  write("times.txt", "7 0.04\n");
  const Result<Dataset> dataset = open_dataset(root_.string(), 10.0);
  ASSERT_TRUE(dataset) << dataset.error().message;
  EXPECT_EQ(dataset->kind, Dataset::Kind::png16);
  EXPECT_THAT(open_clouds(root_.string(), 10.0).error().message, HasSubstr("images, not clouds"));
  EXPECT_EQ(dataset->entries[0].stamp_ns, 40'000'000);
  const Result<Image16> read = read_png16(dataset->entries[0].path);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->width, 3u);
  EXPECT_EQ(read->pixels, image.pixels);
}

TEST_F(DatasetTest, BrokenPngIsRefusedWithAReason) {
  write("images/bad.png", "this is no picture");
  EXPECT_FALSE(read_png16(path("images/bad.png")));
  Image16 image{64, 64, std::vector<std::uint16_t>(64 * 64, 300)};
  ASSERT_TRUE(write_png16(path("images/cut.png"), image));
  fs::resize_file(path("images/cut.png"), fs::file_size(path("images/cut.png")) / 2);
  EXPECT_FALSE(read_png16(path("images/cut.png")));
  EXPECT_FALSE(write_png16(path("images/none.png"), Image16{}));

  // A picture for people; the reader of sensor data refuses it.
  const std::vector<std::uint8_t> bytes(2 * 10, 200);
  ASSERT_TRUE(write_png8(path("picture.png"), {3, 2, 3, 10, bytes}));  // rows of 9 bytes, padded to 10
  EXPECT_FALSE(read_png16(path("picture.png")));
  ASSERT_TRUE(write_png8(path("grey.png"), {10, 2, 1, 0, bytes}));
  EXPECT_FALSE(write_png8(path("short.png"), {4, 2, 3, 0, bytes}));
  EXPECT_FALSE(write_png8(path("none.png"), {}));
  EXPECT_FALSE(write_png8(path("nowhere/picture.png"), {10, 2, 1, 0, bytes}));
}

TEST(SharedData, EveryRecordedFolderOpens) {
  const char* const place = std::getenv("ADIT_SHARED");
  const fs::path shared = fs::path(place ? place : ADIT_SOURCE_DIR "/../shared") / "data";
  if (!fs::exists(shared)) GTEST_SKIP() << "skipped: no shared data";
  struct Expected {
    const char* folder;
    std::size_t entries;
    std::size_t fields;  // 0: images
  };
  for (const Expected& e : {Expected{"subt_anymal_vlp16", 24, 4}, Expected{"synthetic_lidar_64x512", 60, 5},
                            Expected{"opencalib_static_64", 5, 6}, Expected{"vlp16_static", 12, 6},
                            Expected{"indoor_stop_and_go", 13, 4}, Expected{"synthetic_thermal", 110, 0},
                            Expected{"thermal_optris_desk", 50, 0}, Expected{"thermal_lepton_static", 100, 0}}) {
    const Result<Dataset> dataset = open_dataset((shared / e.folder).string(), 9.0);
    ASSERT_TRUE(dataset) << dataset.error().message;
    EXPECT_EQ(dataset->entries.size(), e.entries) << e.folder;
    const Entry& first = dataset->entries.front();
    if (e.fields == 0) {
      EXPECT_TRUE(read_png16(first.path)) << e.folder;
    } else {
      const Result<PointFile> cloud = read_bin(first.path, first.points);
      ASSERT_TRUE(cloud) << cloud.error().message;
      EXPECT_EQ(cloud->fields.size(), e.fields) << e.folder;
    }
  }
}

}  // namespace
}  // namespace adit::dataset
