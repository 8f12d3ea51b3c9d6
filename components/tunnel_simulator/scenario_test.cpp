#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "components/tunnel_simulator/random.hpp"
#include "components/tunnel_simulator/scenario_loader.hpp"
#include "components/tunnel_simulator/simulation.hpp"

namespace adit::tunnel_simulator {
namespace {

const std::filesystem::path kScenarios = std::filesystem::path(ADIT_SOURCE_DIR) / "bringup/scenarios";

std::vector<std::filesystem::path> all_scenarios() {
  std::vector<std::filesystem::path> out;
  for (const auto& entry : std::filesystem::directory_iterator(kScenarios)) {
    if (entry.path().extension() == ".yaml") out.push_back(entry.path());
  }
  std::sort(out.begin(), out.end());
  return out;
}

// A hash of every byte of every sample, and their numbers.
class Digest final : public Sink {
 public:
  std::uint64_t value = 0;
  int scans = 0, images = 0, inertial = 0, fixes = 0, truths = 0;
  std::size_t returns = 0;

  void on_lidar(const LidarScan& scan, const Delivery& d) override {
    ++scans;
    returns += scan.returns();
    add(scan.points.data(), scan.points.size() * sizeof(scan.points[0]));
    add(scan.reflectivity.data(), scan.reflectivity.size() * sizeof(float));
    add(&d.stamp_ns, sizeof d.stamp_ns);
    for (const Eigen::Vector3f& p : scan.points) ASSERT_TRUE(p.allFinite());
  }
  void on_thermal(const ThermalImage& image, const Delivery& d) override {
    ++images;
    add(image.counts.data(), image.counts.size() * sizeof(std::uint16_t));
    add(&d.stamp_ns, sizeof d.stamp_ns);
  }
  void on_imu(const ImuSample& s, const Delivery&) override {
    ++inertial;
    ASSERT_TRUE(s.acceleration.allFinite() && s.rate.allFinite());
    EXPECT_LT(s.acceleration.norm(), 40.0);
    add(s.acceleration.data(), 24);
    add(s.rate.data(), 24);
  }
  void on_gnss(const GnssSample& s, const Delivery&) override {
    ++fixes;
    add(&s.fix, sizeof s.fix);
    if (s.fix != GnssFix::none) add(s.enu.data(), 24);
  }
  void on_truth(double, const Pose& pose) override {
    ++truths;
    add(pose.matrix().data(), 16 * sizeof(double));
  }

 private:
  void add(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (; size >= 8; size -= 8, bytes += 8) {
      std::uint64_t word;
      std::memcpy(&word, bytes, 8);
      value = mix(value ^ word);
    }
    for (; size > 0; --size) value = mix(value ^ *bytes++);
  }
};

Digest run(const std::filesystem::path& path, double duration, int threads, std::int64_t seed = -1) {
  auto scenario = load_scenario(path.string());
  EXPECT_TRUE(scenario) << scenario.error().message;
  if (seed >= 0) scenario->seed = static_cast<std::uint64_t>(seed);
  scenario->lidar.beams.columns = 128;  // an eighth of the sweep and a small camera: seconds, not minutes
  scenario->thermal.camera = CameraModel::from_hfov(80, 64, 1.3);
  auto simulation = Simulation::create(std::move(*scenario), threads);
  EXPECT_TRUE(simulation) << simulation.error().message;
  Digest digest;
  (*simulation)->run(digest, duration);
  return digest;
}

TEST(Scenarios, SixteenAndTheirVariantsParse) {
  const auto files = all_scenarios();
  EXPECT_GE(files.size(), 16U);
  for (int number = 1; number <= 16; ++number) {
    const std::string prefix = (number < 10 ? "s0" : "s") + std::to_string(number);
    EXPECT_TRUE(std::any_of(files.begin(), files.end(), [&](const auto& f) {
      return f.filename().string().rfind(prefix, 0) == 0;
    })) << prefix;
  }
  for (const auto& file : files) {
    const auto scenario = load_scenario(file.string());
    ASSERT_TRUE(scenario) << scenario.error().message;
    EXPECT_EQ(scenario->name, file.stem().string());
  }
}

TEST(Simulation, SameSeedSameBytesForAnyThreads) {
  const auto path = kScenarios / "s14_traffic.yaml";  // rough, warm, with moving vehicles
  const Digest one = run(path, 0.2, 1);
  const Digest two = run(path, 0.2, 2);
  const Digest other = run(path, 0.2, 1, 12345);
  EXPECT_EQ(one.scans, 2);
  EXPECT_EQ(one.images, 6);
  EXPECT_EQ(one.inertial, 41);
  EXPECT_EQ(one.value, two.value);
  EXPECT_NE(one.value, other.value);
}

TEST(Simulation, OutagesSilenceAndFreeze) {
  auto scenario = load_scenario((kScenarios / "s03_featureless.yaml").string());
  ASSERT_TRUE(scenario) << scenario.error().message;
  scenario->lidar.beams.columns = 32;
  scenario->thermal.camera = CameraModel::from_hfov(64, 48, 1.3);
  scenario->outages = {{Sensor::lidar, OutageMode::off, 1.0, 1.0, 0, 0},
                       {Sensor::thermal, OutageMode::frozen, 1.0, 0.5, 0, 0},
                       {Sensor::lidar, OutageMode::delayed, 2.0, 0.5, 0.7, 0},
                       {Sensor::thermal, OutageMode::lossy, 2.0, 1.0, 0, 0.5}};
  struct Watch final : Sink {
    std::vector<Delivery> lidar, thermal;
    std::vector<std::vector<std::uint16_t>> images;
    void on_lidar(const LidarScan&, const Delivery& d) override { lidar.push_back(d); }
    void on_thermal(const ThermalImage& image, const Delivery& d) override {
      thermal.push_back(d);
      images.push_back(image.counts);
    }
  } watch;
  auto simulation = Simulation::create(std::move(*scenario), 1);
  ASSERT_TRUE(simulation);
  (*simulation)->run(watch, 3.0);
  for (const Delivery& d : watch.lidar) {
    EXPECT_FALSE(d.time > 1000.999 && d.time < 1001.999) << d.time;
    const double late = static_cast<double>(d.arrival_ns) * 1e-9 - d.time - 0.1;
    EXPECT_NEAR(late, d.time > 1001.999 && d.time < 1002.499 ? 0.7 : 0.0, 1e-6);
  }
  EXPECT_EQ(watch.lidar.size(), 20U);
  int frozen = 0, in_loss = 0;
  for (std::size_t i = 1; i < watch.thermal.size(); ++i) {
    frozen += watch.thermal[i].repeated ? 1 : 0;
    if (watch.thermal[i].repeated) {
      EXPECT_EQ(watch.images[i], watch.images[i - 1]);
    }
    EXPECT_GT(watch.thermal[i].stamp_ns, watch.thermal[i - 1].stamp_ns);
    in_loss += watch.thermal[i].time >= 1002.0 ? 1 : 0;
  }
  EXPECT_EQ(frozen, 15);
  EXPECT_GT(in_loss, 5);
  EXPECT_LT(in_loss, 25);
}

TEST(Simulation, GnssIsLostInTheTunnel) {
  auto scenario = load_scenario((kScenarios / "s11_portals.yaml").string());
  ASSERT_TRUE(scenario) << scenario.error().message;
  scenario->lidar_on = scenario->thermal_on = false;
  struct Watch final : Sink {
    std::vector<std::pair<double, GnssFix>> fixes;
    void on_gnss(const GnssSample& s, const Delivery& d) override { fixes.emplace_back(d.time - 1000.0, s.fix); }
  } watch;
  auto simulation = Simulation::create(std::move(*scenario), 1);
  ASSERT_TRUE(simulation);
  (*simulation)->run(watch, 200.0);
  const Motion& motion = (*simulation)->motion();
  for (const auto& [time, fix] : watch.fixes) {
    const double d = motion.distance(time) + 10.0;  // from the begin of the cutting
    if (d < 250.0) {
      EXPECT_EQ(fix, GnssFix::rtk_fixed) << d;
    }
    if (d > 320.0 && d < 1280.0) {
      EXPECT_EQ(fix, GnssFix::none) << d;
    }
  }
  EXPECT_EQ(watch.fixes.back().second, GnssFix::rtk_fixed);
}

class BadScenario : public ::testing::Test {
 protected:
  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("adit_scenario_" + std::to_string(::getpid()));
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string good_world() {
    return "name: w\ntubes:\n  - name: main\n    kind: road\n    profile: {shape: road, radius: 5.3}\n    line:\n      "
           "- {straight: 100}\n      - {arc: 50, radius: 200}\n    caps: [begin, end]\n";
  }
  std::string good_scenario() {
    return "name: s\nworld: w.yaml\nfeatures: F0\nduration: 5\nroute:\n  legs:\n    - {tube: main, from: 5, to: "
           "140}\nmotion: {kind: car, speed: 36 km/h}\n";
  }
  // The error after replacing `from` by `to` in the world or the scenario; empty when it is accepted.
  std::string error(const std::string& from, const std::string& to) {
    std::string world = good_world(), scenario = good_scenario();
    for (std::string* text : {&world, &scenario}) {
      const auto at = text->find(from);
      if (!from.empty() && at != std::string::npos) text->replace(at, from.size(), to);
    }
    std::ofstream(folder_ / "w.yaml") << world;
    std::ofstream(folder_ / "s.yaml") << scenario;
    const auto loaded = load_scenario((folder_ / "s.yaml").string());
    return loaded ? "" : loaded.error().message;
  }
  void expect(const std::string& from, const std::string& to, const std::string& place, const std::string& word) {
    const std::string message = error(from, to);
    EXPECT_NE(message.find((folder_ / place).string() + ":"), std::string::npos) << from << " -> " << to << "\n"
                                                                                 << message;
    EXPECT_NE(message.find(word), std::string::npos) << message;
  }
};

TEST_F(BadScenario, IsRefusedWithFileAndLine) {
  EXPECT_EQ(error("", ""), "");
  expect("speed: 36", "sped: 36", "s.yaml:8", "unknown key 'sped'");
  expect("duration: 5", "duration: five", "s.yaml:4", "expected a number");
  expect("duration: 5", "duration: -5", "s.yaml:4", "not within");
  expect("36 km/h", "36 mph", "s.yaml:8", "expected a number");
  expect("kind: car", "kind: boat", "s.yaml:8", "expected one of car, legged");
  expect("features: F0", "features: F7", "s.yaml:3", "expected one of F0, F1, F2");
  expect("tube: main", "tube: mian", "s.yaml:7", "no tube 'mian'");
  expect("to: 140", "to: 190", "s.yaml:7", "beyond the end");
  expect("to: 140", "to: 140, offset: 8", "s.yaml:7", "leaves the tunnel");
  expect("world: w.yaml", "world: v.yaml", "s.yaml:2", "cannot be read");
  expect("name: s", "nam: s", "s.yaml:1", "'name' is missing");
  expect("radius: 5.3", "radius: -5.3", "w.yaml:5", "not within");
  expect("radius: 5.3", "radius: 7.5", "w.yaml:5", "closed section");
  expect("straight: 100", "straight: 100, arc: 3", "w.yaml:7", "exactly one of");
  expect("arc: 50, radius: 200", "arc: 50", "w.yaml:8", "'radius' is missing");
  expect("caps: [begin, end]", "caps: [begin, middle]", "w.yaml:9", "begin and end");
  expect("kind: road", "kind: road\n    kind: rail", "w.yaml:5", "twice");
  expect("name: w", "name: [w", "w.yaml:2", "flow");
  expect("speed: 36 km/h}", "speed: 36 km/h}\noutages:\n  - {sensor: radar, from: 1, duration: 2}", "s.yaml:10",
         "expected one of lidar");
  expect("speed: 36 km/h}", "speed: 36 km/h}\nsensors:\n  thermal: {rate: 60, row_time: 100 us}", "s.yaml:10",
         "longer than a frame");
  EXPECT_NE(load_scenario((folder_ / "nowhere.yaml").string()).error().message.find("cannot be read"),
            std::string::npos);
}

TEST_F(BadScenario, AnyLineBrokenIsRefusedOrHarmless) {
  const auto lines_of = [](const std::filesystem::path& file) {
    std::vector<std::string> lines;
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    return lines;
  };
  int refused = 0;
  const auto write_and_load = [&](const char* file, const std::vector<std::string>& lines) {
    std::ofstream out(folder_ / file);
    for (const std::string& line : lines) out << line << "\n";
    out.close();
    const auto loaded = load_scenario((folder_ / "s.yaml").string());
    if (loaded) return;
    ++refused;
    EXPECT_EQ(loaded.error().message.rfind(folder_.string(), 0), 0U) << loaded.error().message;
  };
  auto scenario = lines_of(kScenarios / "s16_loops.yaml");
  for (std::string& line : scenario) {
    if (line.rfind("world:", 0) == 0) line = "world: w.yaml";
  }
  const auto world = lines_of(kScenarios / "worlds/zab.yaml");
  for (const auto& [file, lines] : {std::pair("w.yaml", world), std::pair("s.yaml", scenario)}) {
    write_and_load("w.yaml", world);
    write_and_load("s.yaml", scenario);
    ASSERT_TRUE(load_scenario((folder_ / "s.yaml").string()));
    refused = 0;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      auto without = lines;
      without.erase(without.begin() + static_cast<std::ptrdiff_t>(i));
      write_and_load(file, without);
      for (const char* word : {"x", "-1", "1e9", "[]"}) {
        for (auto at = lines[i].find(": "); at != std::string::npos; at = lines[i].find(": ", at + 2)) {
          const auto end = std::min(lines[i].find_first_of(",}", at), lines[i].size());
          auto broken = lines;
          broken[i].replace(at + 2, end - at - 2, word);
          write_and_load(file, broken);
        }
      }
    }
    EXPECT_GT(refused, 50) << file;
  }
}

}  // namespace
}  // namespace adit::tunnel_simulator
