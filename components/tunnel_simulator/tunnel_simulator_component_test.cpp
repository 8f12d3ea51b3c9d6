// The component as a deployment has it: a tiny scenario played to a listener of the same process, without middleware.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <thread>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/process.hpp"
#include "components/runtime/stamp.hpp"
#include "components/runtime/testing/harness.hpp"
#include "middleware/participant.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "rosgraph_msgs/msg/clock.hpp"
#include "sensor_msgs/msg/camera_info.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/imu.hpp"
#include "sensor_msgs/msg/nav_sat_fix.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace adit {
namespace {

using namespace std::chrono_literals;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::PointCloud2;
using ::testing::ElementsAre;
using testing::eventually;
using ::testing::HasSubstr;

constexpr Time epoch{1000s};

// What the listener heard, in the order it was published.
struct Heard {
  std::string topic;
  Time stamp{};
  SteadyTime at{};
};

class Record {
 public:
  void clear() {
    const std::lock_guard lock(mutex_);
    heard_.clear();
    points_.clear();
  }
  void add(const std::string& topic, Time stamp) {
    const std::lock_guard lock(mutex_);
    heard_.push_back({topic, stamp, std::chrono::steady_clock::now()});
  }
  void add_points(const PointCloud2& cloud) {
    const std::lock_guard lock(mutex_);
    points_.insert(points_.end(), cloud.data.data(), cloud.data.data() + cloud.data.size());
  }
  std::vector<Heard> heard() const {
    const std::lock_guard lock(mutex_);
    return heard_;
  }
  std::vector<std::uint8_t> points() const {
    const std::lock_guard lock(mutex_);
    return points_;
  }
  std::ptrdiff_t count(const std::string& topic) const {
    const std::lock_guard lock(mutex_);
    return std::count_if(heard_.begin(), heard_.end(), [&](const Heard& h) { return h.topic == topic; });
  }

 private:
  mutable std::mutex mutex_;
  std::vector<Heard> heard_;
  std::vector<std::uint8_t> points_;
};

Record record;
std::atomic<int> answers_left = 0;  // sweeps the listener still answers to
std::atomic<Duration::rep> answer_age = 0;

template <class Message>
auto hear(const char* topic) {
  return [topic](const Message& message, const MessageInfo&) { record.add(topic, to_time(message.header.stamp)); };
}

class Listener final : public Component {
  void answer(const PointCloud2& cloud) {
    record.add("/lidar/points", to_time(cloud.header.stamp));
    record.add_points(cloud);
    last_ = to_time(cloud.header.stamp);
    answered_ = false;
  }
  void reply() {
    if (answered_ || answers_left == 0) return;
    answered_ = true;
    --answers_left;
    Odometry message;
    message.header.stamp = to_stamp(last_ - Duration(answer_age));
    odometry_.publish(message);
  }

  Time last_{};
  bool answered_ = true;
  Output<Odometry> odometry_{*this, "/lidar/odometry", Qos::reliable(10)};
  Timer reply_{*this, "reply", 1ms, [this] { reply(); }};
  Input<rosgraph_msgs::msg::Clock> clock_{*this, "/clock", Qos::clock(), Queue{5000},
                                          [](const rosgraph_msgs::msg::Clock& message, const MessageInfo&) {
                                            record.add("/clock", to_time(message.clock));
                                          }};
  Input<tf2_msgs::msg::TFMessage> rig_{*this, "/tf_static", Qos::latched(), Queue{10},
                                       [](const tf2_msgs::msg::TFMessage& message, const MessageInfo&) {
                                         for (const auto& t : message.transforms) record.add(t.child_frame_id, epoch);
                                         record.add("/tf_static", epoch);
                                       }};
  Input<PointCloud2> points_{*this, "/lidar/points", Qos::reliable(10), Queue{100},
                             [this](const PointCloud2& cloud, const MessageInfo&) { answer(cloud); }};
  Input<sensor_msgs::msg::CameraInfo> camera_info_{*this, "/thermal/camera_info", Qos::reliable(10), Queue{500},
                                                   hear<sensor_msgs::msg::CameraInfo>("/thermal/camera_info")};
  Input<adit_msgs::msg::ThermalFrame> frame_{*this, "/thermal/frame", Qos::reliable(10), Queue{500},
                                             hear<adit_msgs::msg::ThermalFrame>("/thermal/frame")};
  Input<sensor_msgs::msg::Image> image_{*this, "/thermal/image_raw", Qos::reliable(10), Queue{500},
                                        hear<sensor_msgs::msg::Image>("/thermal/image_raw")};
  Input<sensor_msgs::msg::Imu> imu_{*this, "/imu", Qos::reliable(10), Queue{5000}, hear<sensor_msgs::msg::Imu>("/imu")};
  Input<sensor_msgs::msg::NavSatFix> fix_{*this, "/gnss/fix", Qos::reliable(10), Queue{500},
                                          hear<sensor_msgs::msg::NavSatFix>("/gnss/fix")};
  Input<Odometry> truth_{*this, "/ground_truth/odometry", Qos::reliable(10), Queue{5000},
                         hear<Odometry>("/ground_truth/odometry")};
};
ADIT_COMPONENT(Listener, "test_listener");

class TunnelSimulatorComponent : public ::testing::Test {
 protected:
  void SetUp() override {
    record.clear();
    answers_left = 0;
    answer_age = 0;
    std::filesystem::create_directories(folder_);
    std::ofstream(folder_ / "w.yaml")
        << "name: w\ntubes:\n  - name: main\n    kind: road\n    profile: {shape: road, radius: 5.3}\n"
           "    line: [{straight: 150}]\n    caps: [begin, end]\n";
    write("lidar: {columns: 16}\n  thermal: {width: 32, height: 32}\n  gnss: {latency: 0}");
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void write(const std::string& sensors, const std::string& motion = "{kind: car, speed: 36 km/h}") {
    std::ofstream(path_) << "name: s\nworld: w.yaml\nfeatures: F0\nduration: 2\nroute:\n  legs:\n"
                         << "    - {tube: main, from: 5, to: 140}\nmotion: " << motion << "\nsensors:\n  " << sensors
                         << "\n";
  }

  // The simulator and, when `heard`, the listener; started. The error of whatever failed.
  Result<void> start(Value::Map parameters, bool heard = true) {
    const auto otherwise = [&](const char* name, Value value) {
      const auto given = [&](const auto& parameter) { return parameter.first == name; };
      if (std::none_of(parameters.begin(), parameters.end(), given)) parameters.emplace_back(name, std::move(value));
    };
    otherwise("scenario", path_);
    otherwise("rate", 0.0);
    ProcessConfig config;
    config.diagnostics = config.rosout = false;
    config.log_level = LogLevel::off;
    if (heard) config.components.push_back(component("test_listener", {}));
    config.components.push_back(component("tunnel_simulator", std::move(parameters)));
    auto built = Process::build(config);
    if (!built) return built.error();
    process_ = *std::move(built);
    if (auto connected = process_->connect(nullptr); !connected) return connected;
    begin_ = std::chrono::steady_clock::now();
    return process_->start();
  }

  // To the end of the run, and of what the listener still has queued; how the simulator says it went.
  std::string finish() {
    EXPECT_EQ(process_->run({}), 0);
    EXPECT_TRUE(eventually([&] {
      for (const ComponentStatus& status : process_->status()) {
        for (const OutputStatus& output : status.outputs) {
          if (status.type == "tunnel_simulator" &&
              record.count(output.topic) < static_cast<std::ptrdiff_t>(output.stats.published)) {
            return false;
          }
        }
      }
      return true;
    }));
    const std::string reason = simulator().reason;
    process_.reset();
    return reason;
  }

  ComponentStatus simulator() const { return process_->status().back(); }

  static ComponentConfig component(const std::string& type, Value::Map parameters) {
    ComponentConfig config;
    config.type = config.name = type;
    config.log_level = LogLevel::off;
    config.parameters = std::move(parameters);
    return config;
  }

  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("adit_simulator_" + std::to_string(::getpid()));
  std::string path_ = (folder_ / "s.yaml").string();
  std::unique_ptr<Process> process_;
  SteadyTime begin_{};
};

TEST_F(TunnelSimulatorComponent, EverySensorInTheOrderOfArrivalUnderARisingClock) {
  const auto started = start({{"duration", 0.5}});
  ASSERT_TRUE(started) << started.error().message;
  EXPECT_EQ(finish(), "simulated 0.500000 s");
  EXPECT_EQ(record.count("/lidar/points"), 5);    // 10 Hz
  EXPECT_EQ(record.count("/thermal/frame"), 15);  // 30 Hz
  EXPECT_EQ(record.count("/thermal/camera_info"), 15);
  EXPECT_EQ(record.count("/thermal/image_raw"), 15);
  EXPECT_EQ(record.count("/imu"), 101);                   // 200 Hz
  EXPECT_EQ(record.count("/gnss/fix"), 6);                // 10 Hz
  EXPECT_EQ(record.count("/ground_truth/odometry"), 51);  // 100 Hz
  EXPECT_EQ(record.count("/tf_static"), 1);
  EXPECT_EQ(record.count("/clock"), 5 + 3 * 15 + 101 + 6 + 51);  // one before each sample

  const std::vector<Heard> heard = record.heard();
  Time clock{}, calibrated{};
  const std::vector<std::string> rig{"lidar", "thermal_optical", "imu", "/tf_static"};
  for (std::size_t i = 0; i < rig.size(); ++i) EXPECT_EQ(heard[i].topic, rig[i]);  // before all else
  for (std::size_t i = rig.size(); i < heard.size(); ++i) {
    const auto& [topic, stamp, at] = heard[i];
    if (topic == "/clock") {
      EXPECT_GE(stamp, clock) << i;
      clock = stamp;
      continue;
    }
    EXPECT_EQ(heard[i - 1].topic, "/clock") << i << topic;
    EXPECT_LE(stamp, clock) << topic;  // known when it was measured, not before
    EXPECT_LT(clock - stamp, 150ms) << topic;
    if (topic == "/ground_truth/odometry") {
      EXPECT_EQ(stamp, clock);
    }
    if (topic == "/thermal/camera_info") calibrated = stamp;
    if (topic == "/thermal/frame" || topic == "/thermal/image_raw") {
      EXPECT_EQ(stamp, calibrated) << topic;
    }
  }
  EXPECT_LE(clock, epoch + 500ms);
  EXPECT_GE(clock, epoch + 490ms);
}

TEST_F(TunnelSimulatorComponent, TheSeedMakesTheBytes) {
  const auto points = [&](std::int64_t seed) {
    record.clear();
    EXPECT_TRUE(start({{"duration", 0.2}, {"seed", seed}}));
    finish();
    return record.points();
  };
  const auto one = points(1);
  EXPECT_FALSE(one.empty());
  EXPECT_EQ(points(1), one);
  EXPECT_EQ(points(-1), one);  // the scenario's own
  EXPECT_NE(points(2), one);
}

TEST_F(TunnelSimulatorComponent, BeginsWhenSomebodyReads) {
  ASSERT_TRUE(start({{"duration", 0.2}}, false));
  EXPECT_TRUE(eventually([&] { return simulator().reason == "waiting for somebody to read"; }));
  for (const OutputStatus& output : simulator().outputs) EXPECT_EQ(output.stats.published, 0u) << output.topic;
  ASSERT_TRUE(start({{"duration", 0.2}, {"wait_for_readers", false}}, false));
  EXPECT_EQ(process_->run({}), 0);
}

TEST_F(TunnelSimulatorComponent, WaitsForTheNamedConsumersAnswer) {
  ASSERT_TRUE(start({{"duration", 0.5}, {"wait_for", Value::List{"lidar"}}, {"answer_timeout", 300.0}}));
  ASSERT_TRUE(eventually([] { return record.count("/lidar/points") == 1; }));
  std::this_thread::sleep_for(300ms);
  EXPECT_EQ(record.count("/lidar/points"), 1);
  EXPECT_EQ(record.heard().back().topic, "/lidar/points");  // nothing went on without the answer

  answer_age = 1;  // a nanosecond older than the sweep: the answer to an earlier one
  answers_left = 1;
  ASSERT_TRUE(eventually([] { return answers_left == 0; }));
  std::this_thread::sleep_for(200ms);
  EXPECT_EQ(record.heard().back().topic, "/lidar/points");
  EXPECT_EQ(record.count("/lidar/points"), 1);
}

TEST_F(TunnelSimulatorComponent, GoesOnWithTheAnswerAndLosesNothing) {
  answers_left = 100;
  ASSERT_TRUE(start({{"duration", 0.5}, {"wait_for", Value::List{"lidar"}}, {"answer_timeout", 300.0}}));
  EXPECT_EQ(finish(), "simulated 0.500000 s");
  EXPECT_EQ(record.count("/lidar/points"), 5);
  EXPECT_EQ(answers_left, 95);
}

TEST_F(TunnelSimulatorComponent, GoesOnWithoutAnAnswerAfterTheTimeoutAndCountsIt) {
  ASSERT_TRUE(start({{"duration", 0.3}, {"wait_for", Value::List{"lidar"}}, {"answer_timeout", 0.1}}));
  EXPECT_EQ(finish(), "simulated 0.300000 s, 3 unanswered");
  EXPECT_GE(std::chrono::steady_clock::now() - begin_, 300ms);
}

TEST_F(TunnelSimulatorComponent, RateIsTheSpeedOfPlaying) {
  write("lidar: {enabled: false}\n  thermal: {enabled: false}");
  ASSERT_TRUE(start({{"rate", 4.0}}));
  EXPECT_EQ(finish(), "simulated 2.000000 s");
  const std::vector<Heard> heard = record.heard();
  for (const Heard& h : heard) EXPECT_GE(h.at - begin_, (h.stamp - epoch) / 4) << h.topic;  // never early
  EXPECT_LT(heard.back().at - begin_, 1900ms);
  EXPECT_EQ(record.count("/imu"), 401);
}

TEST_F(TunnelSimulatorComponent, RefusesABadScenarioWithFileAndLine) {
  const auto error = [&](Value::Map parameters = {}) {
    const auto started = start(std::move(parameters));
    return started ? "" : started.error().message;
  };
  write("lidar: {columns: 16}", "{kind: car, sped: 36 km/h}");
  EXPECT_THAT(error(), HasSubstr(path_ + ":8: "));
  EXPECT_THAT(error(), HasSubstr("unknown key 'sped'"));
  write("lidar: {columns: 16}", "{kind: car, speed: 36 mph}");
  EXPECT_THAT(error(), HasSubstr(path_ + ":8: "));
  write("lidar: {columns: 16}");
  EXPECT_THAT(error({{"scenario", ""}}), HasSubstr("'scenario' is empty"));
  EXPECT_THAT(error({{"wait_for", Value::List{"lidar", "radar"}}}), HasSubstr("'radar' is not lidar or thermal"));
  EXPECT_EQ(error(), "");
}

}  // namespace
}  // namespace adit
