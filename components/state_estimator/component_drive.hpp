// A drive as the component's tests have it: synthetic odometries in, what it publishes out, in simulated time.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "adit_msgs/msg/fusion_status.hpp"
#include "adit_msgs/msg/thermal_health.hpp"
#include "components/geometry/se3.hpp"
#include "components/runtime/component_config.hpp"
#include "components/runtime/testing/recording.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/nav_sat_fix.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace adit::state_estimator::test {

using namespace std::chrono_literals;
using adit::testing::Recording;
using adit_msgs::msg::FusionStatus;
using adit_msgs::msg::SensorStatus;
using nav_msgs::msg::Odometry;
using tf2_msgs::msg::TFMessage;

inline constexpr double speed = 5.0, curvature = 0.02;  // m/s, 1/m
inline constexpr Duration begin = 1000s;

// From rest to `speed` in 4 s, then on: 40 m in 10 s.
double way(double t);
// Along an arc, from the origin along x.
Pose arc(double t);
Odometry odometry(Duration stamp, const Pose& pose, const std::string& frame);
void set_covariance(Odometry& message, const std::array<double, 6>& variances);

struct SyntheticDrive {
  bool lidar = true, thermal = true;
  Duration length = 10s;
  using Change = std::function<void(Odometry&, Duration& arrival, int index)>;
  Change change_lidar = nullptr;
  Change change_thermal = nullptr;
  std::function<void(sensor_msgs::msg::NavSatFix&, double t)> fix = nullptr;  // 5 Hz where set
  // What the front ends say of themselves, where set: matched points of a sweep, state and ln(scale) deviation.
  std::function<unsigned(double t)> lidar_matches = nullptr;
  std::function<void(adit_msgs::msg::ThermalHealth&, double t)> thermal_health = nullptr;

  Recording record() const;
};

struct Outcome {
  std::vector<Odometry> poses;
  std::vector<TFMessage> transforms;
  std::vector<FusionStatus> status;
  std::vector<std::byte> bytes;

  const SensorStatus& sensor(const std::string& name) const;  // of the last status
  Eigen::Vector3d end() const;
};

// Of the last pose, which is of a moment after the last stamp [m].
double error(const Outcome& out);
ComponentConfig estimator(Value::Map parameters = {});
bool finite(const Odometry& m);
// Whatever went in: an output each 10 ms, finite, with its transform and status.
void expect_continuous(const Outcome& out, std::size_t at_least);
Outcome run(const SyntheticDrive& drive, Value::Map parameters = {});

}  // namespace adit::state_estimator::test
