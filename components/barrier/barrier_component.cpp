#include <algorithm>
#include <array>

#include "adit_msgs/msg/thermal_health.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"
#include "nav_msgs/msg/odometry.hpp"

namespace adit {
namespace {

// Answers to a source when every consumer has: with the stamp that all of them have reached.
class BarrierComponent final : public Component {
  using Odometry = nav_msgs::msg::Odometry;
  using Health = adit_msgs::msg::ThermalHealth;

  Param<std::int64_t> lidar_consumers_{*this, "lidar_consumers", 1, Range{0, 3}, "lidar_1 to lidar_N are waited for"};
  Param<std::int64_t> thermal_consumers_{*this, "thermal_consumers", 0, Range{0, 2}, "thermal_1 to thermal_N are"};

  Output<Odometry> lidar_{*this, "lidar", Qos::reliable(10)};
  Output<Odometry> thermal_{*this, "thermal", Qos::reliable(10)};
  Input<Odometry> lidar_1_{*this, "lidar_1", Qos::reliable(10), Queue{10, WhenFull::drop_oldest},
                           [this](const Odometry& m, const MessageInfo&) { lidar(0, to_time(m.header.stamp)); }};
  Input<Odometry> lidar_2_{*this, "lidar_2", Qos::reliable(10), Queue{10, WhenFull::drop_oldest},
                           [this](const Odometry& m, const MessageInfo&) { lidar(1, to_time(m.header.stamp)); }};
  Input<Odometry> lidar_3_{*this, "lidar_3", Qos::reliable(10), Queue{10, WhenFull::drop_oldest},
                           [this](const Odometry& m, const MessageInfo&) { lidar(2, to_time(m.header.stamp)); }};
  // The health: it comes with every frame, the odometry only with those that were tracked.
  Input<Health> thermal_1_{*this, "thermal_1", Qos::reliable(10), Queue{10, WhenFull::drop_oldest},
                           [this](const Health& m, const MessageInfo&) { thermal(0, to_time(m.header.stamp)); }};
  Input<Health> thermal_2_{*this, "thermal_2", Qos::reliable(10), Queue{10, WhenFull::drop_oldest},
                           [this](const Health& m, const MessageInfo&) { thermal(1, to_time(m.header.stamp)); }};

  std::array<Time, 3> lidar_at_{};
  std::array<Time, 2> thermal_at_{};
  Time lidar_answered_{}, thermal_answered_{};

  Result<void> activate() override {
    forget();
    return {};
  }
  void on_time_jump(Duration) override { forget(); }
  void forget() {
    lidar_at_ = {};
    thermal_at_ = {};
    lidar_answered_ = thermal_answered_ = {};
  }

  void lidar(std::size_t consumer, Time stamp) {
    lidar_at_[consumer] = stamp;
    const auto end = lidar_at_.begin() + lidar_consumers_.value();
    if (lidar_consumers_ > 0) answer(*std::min_element(lidar_at_.begin(), end), lidar_answered_, lidar_);
  }
  void thermal(std::size_t consumer, Time stamp) {
    thermal_at_[consumer] = stamp;
    const auto end = thermal_at_.begin() + thermal_consumers_.value();
    if (thermal_consumers_ > 0) answer(*std::min_element(thermal_at_.begin(), end), thermal_answered_, thermal_);
  }
  static void answer(Time reached, Time& answered, Output<Odometry>& output) {
    if (reached <= answered) return;
    answered = reached;
    Odometry message;
    message.header.stamp = to_stamp(reached);
    output.publish(message);
  }
};

ADIT_COMPONENT(BarrierComponent, "barrier");

}  // namespace
}  // namespace adit
