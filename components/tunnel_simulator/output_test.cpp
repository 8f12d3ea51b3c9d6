// What a run leaves on disk: the documented folder, and a bag; the same bytes for the same seed.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>

#include "components/dataset/bag_reader.hpp"
#include "components/dataset/dataset.hpp"
#include "components/dataset/png16.hpp"
#include "components/dataset/point_file.hpp"
#include "components/geometry/trajectory.hpp"
#include "components/tunnel_simulator/bag_sink.hpp"
#include "components/tunnel_simulator/folder_writer.hpp"
#include "components/tunnel_simulator/scenario_loader.hpp"
#include "components/tunnel_simulator/sensor_messages.hpp"
#include "idl/codec.hpp"
#include "idl/point_cloud_view.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit::tunnel_simulator {
namespace {

namespace fs = std::filesystem;

class Output : public ::testing::Test {
 protected:
  fs::path folder_ = fs::temp_directory_path() / ("adit_simulated_" + std::to_string(::getpid()));
  void TearDown() override { fs::remove_all(folder_); }

  static std::unique_ptr<Simulation> small_run(std::uint64_t seed, int threads) {
    Scenario s = *load_scenario(std::string(ADIT_SOURCE_DIR) + "/bringup/scenarios/s11_portals.yaml");
    s.seed = seed;
    s.duration = 0.35;
    s.lidar.beams.columns = 64;
    s.thermal.camera = CameraModel::from_hfov(80, 64, 1.3);
    s.view_radius = 40.0;
    return *Simulation::create(std::move(s), threads);
  }
  fs::path folder_of(const char* name, std::uint64_t seed, int threads) const {
    const auto simulation = small_run(seed, threads);
    auto writer = FolderWriter::open((folder_ / name).string(), *simulation);
    EXPECT_TRUE(writer);
    simulation->run(**writer, 1.0);
    EXPECT_TRUE((*writer)->finish());
    return folder_ / name;
  }
  fs::path bag_of(const char* name, std::uint64_t seed, int threads) const {
    const auto simulation = small_run(seed, threads);
    const fs::path path = folder_ / name / "run";
    auto sink = BagSink::create(path.string(), *simulation, true);
    EXPECT_TRUE(sink);
    simulation->run(**sink, 1.0);
    EXPECT_TRUE((*sink)->finish());
    return path;
  }
  // Every file below a folder, by relative path.
  static std::map<std::string, std::string> contents(const fs::path& folder) {
    std::map<std::string, std::string> out;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (!entry.is_regular_file()) continue;
      std::ifstream in(entry.path(), std::ios::binary);
      out[fs::relative(entry.path(), folder).string()] = {std::istreambuf_iterator<char>(in), {}};
    }
    return out;
  }
};

TEST_F(Output, FolderIsAsDocumented) {
  const fs::path folder = folder_of("a", 1, 1);
  struct Keep final : Sink {
    std::vector<LidarScan> scans;
    std::vector<ThermalImage> images;
    void on_lidar(const LidarScan& s, const Delivery&) override { scans.push_back(s); }
    void on_thermal(const ThermalImage& i, const Delivery&) override { images.push_back(i); }
  } keep;
  const auto simulation = small_run(1, 1);
  simulation->run(keep, 1.0);
  ASSERT_EQ(keep.scans.size(), 3U);
  ASSERT_EQ(keep.images.size(), 11U);

  const auto scans = dataset::open_dataset(folder.string(), 10.0);
  ASSERT_TRUE(scans) << scans.error().message;
  ASSERT_EQ(scans->entries.size(), 3U);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(scans->entries[k].stamp_ns, keep.scans[k].stamp_ns);
    const auto cloud = dataset::read_bin(scans->entries[k].path, scans->entries[k].points);
    ASSERT_TRUE(cloud);
    ASSERT_EQ(cloud->fields.size(), 6U);
    ASSERT_EQ(cloud->points, keep.scans[k].returns());
    float last = 0.0F;
    for (std::size_t i = 0; i < cloud->points; ++i) {
      const float* row = cloud->values.data() + 6 * i;
      EXPECT_GE(row[4], last);  // in time order
      last = row[4];
      const auto ring = static_cast<std::size_t>(row[5]);
      const auto column = static_cast<std::size_t>(std::lround(static_cast<double>(row[4]) * 640.0));
      EXPECT_EQ(keep.scans[k].points[ring * 64 + column], Eigen::Vector3f(row[0], row[1], row[2]));
      EXPECT_EQ(keep.scans[k].reflectivity[ring * 64 + column], row[3]);
    }
  }
  const auto image = dataset::read_png16((folder / "images/000004.png").string());
  ASSERT_TRUE(image);
  EXPECT_EQ(image->pixels, keep.images[4].counts);
  for (const auto& [file, poses] :
       {std::pair{"gt_start.tum", 3U}, {"gt_mid.tum", 3U}, {"gt_end.tum", 3U}, {"gt.tum", 11U}, {"gt_base.tum", 36U}}) {
    const auto trajectory = read_tum((folder / file).string());
    ASSERT_TRUE(trajectory) << trajectory.error().message;
    EXPECT_EQ(trajectory->size(), poses) << file;
  }
  const auto start = read_tum((folder / "gt_start.tum").string());
  EXPECT_TRUE((*start)[1].pose.isApprox(simulation->lidar(0.1), 1e-8));
  const auto thermal = read_tum((folder / "gt.tum").string());
  EXPECT_TRUE((*thermal)[3].pose.isApprox(simulation->thermal(0.1 + 64.0 * 16e-6), 1e-8));
  std::istringstream calibration(contents(folder)["calib.txt"]);
  double fx = 0.0;
  calibration >> fx;
  EXPECT_NEAR(fx, CameraModel::from_hfov(80, 64, 1.3).fx, 1e-6);
  for (const char* file : {"times.txt", "thermal.csv", "extrinsics.yaml", "imu.csv", "gnss.csv"}) {
    EXPECT_FALSE(contents(folder)[file].empty()) << file;
  }
}

TEST_F(Output, SameSeedSameFiles) {
  const auto one = contents(folder_of("a", 7, 1));
  EXPECT_EQ(one, contents(folder_of("b", 7, 2)));
  const auto other = contents(folder_of("c", 8, 1));
  ASSERT_EQ(one.size(), other.size());
  EXPECT_NE(one.at("scans/000000.bin"), other.at("scans/000000.bin"));
  EXPECT_NE(one.at("images/000000.png"), other.at("images/000000.png"));
  EXPECT_NE(one.at("imu.csv"), other.at("imu.csv"));
}

TEST_F(Output, SameSeedSameBag) {
  const fs::path bag = bag_of("a", 7, 1);
  const auto one = contents(bag);
  EXPECT_EQ(one.size(), 2U);  // the database and metadata.yaml
  EXPECT_EQ(one, contents(bag_of("b", 7, 2)));
  EXPECT_NE(one.at("run_0.db3"), contents(bag_of("c", 8, 1)).at("run_0.db3"));
}

TEST_F(Output, BagHoldsThePublishedMessages) {
  const fs::path bag = bag_of("a", 1, 1);
  auto reader = dataset::BagReader::open(bag.string());
  ASSERT_TRUE(reader) << reader.error().message;
  const dataset::BagInfo& info = (*reader)->info();
  std::map<std::string, std::uint64_t> counts;
  for (std::size_t i = 0; i < info.topics.size(); ++i) {
    counts[info.topics[i].name] = info.counts[i];
    EXPECT_EQ(info.topics[i].type_hash.substr(0, 7), "RIHS01_");
    EXPECT_FALSE(info.topics[i].schema.empty());
  }
  const std::map<std::string, std::uint64_t> expected{{"/tf_static", 1},
                                                      {"/lidar/points", 3},
                                                      {"/thermal/frame", 11},
                                                      {"/thermal/camera_info", 11},
                                                      {"/thermal/image_raw", 11},
                                                      {"/imu", 71},
                                                      {"/gnss/fix", counts["/gnss/fix"]},
                                                      {"/ground_truth/odometry", 36}};
  EXPECT_EQ(counts, expected);
  EXPECT_GE(counts["/gnss/fix"], 3U);

  struct Keep final : Sink {
    std::vector<LidarScan> scans;
    void on_lidar(const LidarScan& s, const Delivery&) override { scans.push_back(s); }
  } keep;
  small_run(1, 1)->run(keep, 1.0);
  ASSERT_TRUE((*reader)->select({"/lidar/points"}));
  dataset::BagSample sample;
  for (const LidarScan& scan : keep.scans) {
    ASSERT_TRUE(*(*reader)->next(sample));
    EXPECT_EQ(sample.stamp_ns, scan.stamp_ns + 100'000'000);  // arrives when the sweep is over
    sensor_msgs::msg::PointCloud2 cloud;
    ASSERT_EQ(decode(sample.cdr, cloud), DecodeStatus::ok);
    const auto view = PointCloudView::of(cloud);
    ASSERT_TRUE(view);
    ASSERT_EQ(view->size(), scan.points.size());
    for (std::size_t i = 0; i < scan.points.size(); ++i) {
      if (scan.ranges[i] <= 0.0F) continue;
      const auto [x, y, z] = view->position(i);
      ASSERT_EQ(Eigen::Vector3f(x, y, z), scan.points[i]);
    }
  }
}

TEST_F(Output, AFolderThatCannotBeWrittenIsAnError) {
  fs::create_directories(folder_);
  std::ofstream(folder_ / "file") << "in the way";
  const auto simulation = small_run(1, 1);
  EXPECT_FALSE(FolderWriter::open((folder_ / "file" / "x").string(), *simulation));
  EXPECT_FALSE(BagSink::create((folder_ / "file" / "x").string(), *simulation, false));
}

}  // namespace
}  // namespace adit::tunnel_simulator
