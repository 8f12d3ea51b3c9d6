// Every scenario runs its first five seconds at full sensor rates. Minutes: label slow.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "components/tunnel_simulator/scenario_loader.hpp"
#include "components/tunnel_simulator/simulation.hpp"

namespace adit::tunnel_simulator {
namespace {

std::vector<std::string> scenario_names() {
  std::vector<std::string> out;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::path(ADIT_SOURCE_DIR) / "bringup/scenarios")) {
    if (entry.path().extension() == ".yaml") out.push_back(entry.path().stem().string());
  }
  std::sort(out.begin(), out.end());
  return out;
}

class FirstSeconds : public ::testing::TestWithParam<std::string> {};

TEST_P(FirstSeconds, MakePlausibleData) {
  auto scenario =
      load_scenario((std::filesystem::path(ADIT_SOURCE_DIR) / "bringup/scenarios" / (GetParam() + ".yaml")).string());
  ASSERT_TRUE(scenario) << scenario.error().message;
  const bool lossy = scenario->timing[0].loss > 0.0;
  const double texture = scenario->world.texture;
  auto simulation = Simulation::create(std::move(*scenario), 2);
  ASSERT_TRUE(simulation) << simulation.error().message;
  struct Watch final : Sink {
    int scans = 0, images = 0, inertial = 0, fixes = 0, truths = 0;
    double least_share = 1.0, least_spread = 1e9;
    void on_lidar(const LidarScan& s, const Delivery&) override {
      ++scans;
      least_share = std::min(least_share, static_cast<double>(s.returns()) / static_cast<double>(s.ranges.size()));
    }
    void on_thermal(const ThermalImage& image, const Delivery&) override {
      ++images;
      const auto [low, high] = std::minmax_element(image.counts.begin(), image.counts.end());
      least_spread = std::min(least_spread, static_cast<double>(*high - *low));
    }
    void on_imu(const ImuSample&, const Delivery&) override { ++inertial; }
    void on_gnss(const GnssSample&, const Delivery&) override { ++fixes; }
    void on_truth(double, const Pose&) override { ++truths; }
  } watch;
  (*simulation)->run(watch, 5.0);
  EXPECT_GE(watch.scans, lossy ? 35 : 50);
  EXPECT_GE(watch.images, lossy ? 100 : 149);
  EXPECT_GE(watch.inertial, 990);
  EXPECT_GE(watch.fixes, 50);
  EXPECT_EQ(watch.truths, 501);
  EXPECT_GT(watch.least_share, GetParam() == "s11_portals" ? 0.3 : 0.5);
  EXPECT_GT(watch.least_spread, texture > 1 ? 300.0 : 5.0);
}

INSTANTIATE_TEST_SUITE_P(Scenarios, FirstSeconds, ::testing::ValuesIn(scenario_names()),
                         [](const auto& i) { return i.param; });

}  // namespace
}  // namespace adit::tunnel_simulator
