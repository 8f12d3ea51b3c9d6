#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"
#include "components/tunnel_simulator/scenario_loader.hpp"
#include "components/tunnel_simulator/sensor_messages.hpp"
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

namespace sim = tunnel_simulator;
using nav_msgs::msg::Odometry;

// Plays a scenario as live sensors: samples go out when they arrive (latency included), in order, /clock before each.
// Needs the system's clock itself: it is the one that makes the simulated one.
class TunnelSimulatorComponent final : public Component, private sim::Sink {
  Param<std::string> scenario_{*this, "scenario", std::string(), "scenario file to run"};
  Param<double> rate_{*this, "rate", 1.0, Range{0.0, 100.0}, "times real time; 0: as fast as it goes"};
  Param<double> duration_{*this, "duration", 0.0, Unit::second, Range{0.0, 1e6}, "stop here; 0: the scenario's end"};
  Param<std::int64_t> seed_{*this, "seed", -1, Range{-1, 2e9}, "instead of the scenario's; -1: that one"};
  Param<std::int64_t> threads_{*this, "threads", 1, Range{1, 64}, "for casting rays; the data do not depend on it"};
  Param<std::vector<std::string>> wait_for_{
      *this, "wait_for", {}, "of lidar, thermal: go on only when its odometry has answered to the last sample"};
  Param<double> answer_timeout_{*this,        "answer_timeout",  5.0,
                                Unit::second, Range{0.1, 600.0}, "go on without after this time"};
  Param<bool> wait_for_readers_{*this, "wait_for_readers", true, "begin when somebody reads a sensor's topic"};

  Output<sensor_msgs::msg::PointCloud2> points_{*this, "/lidar/points", Qos::reliable(10)};
  Output<adit_msgs::msg::ThermalFrame> frame_{*this, "/thermal/frame", Qos::reliable(10)};
  Output<sensor_msgs::msg::Image> image_{*this, "/thermal/image_raw", Qos::reliable(10)};
  Output<sensor_msgs::msg::CameraInfo> camera_info_{*this, "/thermal/camera_info", Qos::reliable(10)};
  Output<sensor_msgs::msg::Imu> imu_{*this, "/imu", Qos::reliable(200)};
  Output<sensor_msgs::msg::NavSatFix> fix_{*this, "/gnss/fix", Qos::reliable(10)};
  Output<Odometry> truth_{*this, "/ground_truth/odometry", Qos::reliable(100)};
  Output<rosgraph_msgs::msg::Clock> clock_out_{*this, "/clock", Qos::clock()};
  Output<tf2_msgs::msg::TFMessage> rig_{*this, "/tf_static", Qos::latched()};
  Input<Odometry> lidar_answer_{*this, "/lidar/odometry", Qos::reliable(10), Queue{10, WhenFull::drop_oldest},
                                [this](const Odometry& m, const MessageInfo&) { answered(lidar_, m); }};
  Input<Odometry> thermal_answer_{*this, "/thermal/odometry", Qos::reliable(10), Queue{10, WhenFull::drop_oldest},
                                  [this](const Odometry& m, const MessageInfo&) { answered(thermal_, m); }};
  Timer tick_{*this, "play", std::chrono::milliseconds(50), [this] { tick(); }};

  // A consumer that is waited for.
  struct Consumer {
    bool wanted = false;
    Time sent{}, answer{};
    bool pending() const { return wanted && answer < sent; }
  };

  std::unique_ptr<sim::Simulation> simulation_;
  std::multimap<std::int64_t, std::function<void()>> mail_;  // by arrival [ns]; equal arrivals keep their order
  Consumer lidar_, thermal_;
  double end_ = 0.0;
  bool started_ = false, done_ = false;
  std::uint64_t unanswered_ = 0;
  std::chrono::steady_clock::time_point begin_{}, waiting_since_{};

  Result<void> configure() override {
    if (scenario_.value().empty())
      return Error{ErrorCode::invalid_argument, "parameter 'scenario' is empty: name a scenario file"};
    auto scenario = sim::load_scenario(scenario_);
    if (!scenario) return scenario.error();
    if (seed_ >= 0) scenario->seed = static_cast<std::uint64_t>(seed_.value());
    for (const std::string& name : wait_for_.value()) {
      if (name != "lidar" && name != "thermal") {
        return Error{ErrorCode::invalid_argument, "parameter 'wait_for': '" + name + "' is not lidar or thermal"};
      }
    }
    end_ = duration_ > 0.0 ? std::min(duration_.value(), scenario->duration) : scenario->duration;
    auto simulation = sim::Simulation::create(std::move(*scenario), static_cast<int>(threads_.value()));
    if (!simulation) return simulation.error();
    simulation_ = std::move(*simulation);
    const auto waits = [&](const char* name) {
      return std::find(wait_for_.value().begin(), wait_for_.value().end(), name) != wait_for_.value().end();
    };
    lidar_ = {waits("lidar"), {}, {}};
    thermal_ = {waits("thermal"), {}, {}};
    started_ = done_ = false;
    mail_.clear();
    return {};
  }

  Result<void> activate() override {
    tick_.set_period(std::chrono::milliseconds(50));
    return {};
  }

  Result<void> cleanup() override {
    simulation_.reset();
    return {};
  }

  void tick() {
    if (done_) return;
    if (!started_) {
      if (wait_for_readers_ && !points_.has_readers() && !frame_.has_readers() && !image_.has_readers() &&
          !imu_.has_readers()) {
        health(Health::ok, "waiting for somebody to read");
        return;
      }
      started_ = true;
      begin_ = std::chrono::steady_clock::now();
      tf2_msgs::msg::TFMessage rig;
      sim::fill_rig(simulation_->scenario(), rig);
      rig_.publish(rig);
    }
    if (lidar_.pending() || thermal_.pending()) {
      if (seconds_since(waiting_since_) < answer_timeout_) return tick_.set_period(std::chrono::milliseconds(20));
      ++unanswered_;
      lidar_.answer = lidar_.sent;
      thermal_.answer = thermal_.sent;
      log().warn("no answer within {} s, going on ({} so far)", answer_timeout_.value(), unanswered_);
    }
    advance();
  }

  // One sample at most, then back to the executor, so that answers are heard in between.
  void advance() {
    const double ready = simulation_->ready();
    const bool over = ready > end_ + 1e-9;
    if (over && mail_.empty()) return finish_run();
    const double next_mail =
        mail_.empty() ? 1e18 : 1e-9 * static_cast<double>(mail_.begin()->first) - simulation_->scenario().epoch;
    const double due = over ? next_mail : std::min(ready, next_mail);
    if (rate_ > 0.0) {
      const double early = due / rate_ - seconds_since(begin_);
      if (early > 1e-4) return tick_.set_period(Duration(std::llround(early * 1e9)));
    }
    if (next_mail <= ready || over) {
      const auto node = mail_.extract(mail_.begin());
      rosgraph_msgs::msg::Clock clock;
      clock.clock = to_stamp(Time(Duration(node.key())));
      clock_out_.publish(clock);
      node.mapped()();
    } else {
      simulation_->step(*this);
    }
    tick_.set_period(std::chrono::microseconds(1));
  }

  void finish_run() {
    done_ = true;
    const std::string text = "simulated " + std::to_string(end_) + " s" +
                             (unanswered_ > 0 ? ", " + std::to_string(unanswered_) + " unanswered" : "");
    health(unanswered_ > 0 ? Health::warn : Health::ok, text);
    log().info("{}: {}", simulation_->scenario().name, text);
    finish();
  }

  void answered(Consumer& consumer, const Odometry& message) {
    consumer.answer = std::max(consumer.answer, to_time(message.header.stamp));
    if (started_ && !done_ && !lidar_.pending() && !thermal_.pending()) tick_.set_period(std::chrono::microseconds(1));
  }

  static double seconds_since(std::chrono::steady_clock::time_point then) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - then).count();
  }

  template <class Message>
  void post(const sim::Delivery& delivery, Output<Message>& output, std::shared_ptr<Message> message,
            Consumer* consumer = nullptr) {
    mail_.emplace(delivery.arrival_ns, [this, &output, consumer, message = std::move(message)] {
      output.publish(std::shared_ptr<const Message>(message));
      if (consumer != nullptr) {
        consumer->sent = std::max(consumer->sent, to_time(message->header.stamp));
        waiting_since_ = std::chrono::steady_clock::now();
      }
    });
  }

  void on_lidar(const sim::LidarScan& scan, const sim::Delivery& delivery) override {
    auto message = std::make_shared<sensor_msgs::msg::PointCloud2>();
    if (auto filled = sim::fill(scan, delivery, *message); !filled) {
      log().error("{}", filled.error().message);
      return;
    }
    post(delivery, points_, std::move(message), &lidar_);
  }
  void on_thermal(const sim::ThermalImage& image, const sim::Delivery& delivery) override {
    // The calibration goes first: who answers to a frame needs it, and the frame's answer is waited for.
    if (camera_info_.has_readers()) {
      auto info = std::make_shared<sensor_msgs::msg::CameraInfo>();
      sim::fill_camera_info(delivery, simulation_->scenario(), *info);
      post(delivery, camera_info_, std::move(info));
    }
    if (image_.has_readers()) {
      auto plain = std::make_shared<sensor_msgs::msg::Image>();
      sim::fill(image, delivery, simulation_->scenario(), *plain);
      post(delivery, image_, std::move(plain));
    }
    auto message = std::make_shared<adit_msgs::msg::ThermalFrame>();
    sim::fill(image, delivery, simulation_->scenario(), *message);
    post(delivery, frame_, std::move(message), &thermal_);
  }
  void on_imu(const sim::ImuSample& sample, const sim::Delivery& delivery) override {
    auto message = std::make_shared<sensor_msgs::msg::Imu>();
    sim::fill(sample, simulation_->scenario().imu, *message);
    post(delivery, imu_, std::move(message));
  }
  void on_gnss(const sim::GnssSample& sample, const sim::Delivery& delivery) override {
    auto message = std::make_shared<sensor_msgs::msg::NavSatFix>();
    sim::fill(sample, *message);
    post(delivery, fix_, std::move(message));
  }
  void on_truth(double time, const Pose&) override {
    auto message = std::make_shared<Odometry>();
    sim::fill_truth(*simulation_, time - simulation_->scenario().epoch, *message);
    sim::Delivery delivery;
    delivery.arrival_ns = std::llround(time * 1e9);
    post(delivery, truth_, std::move(message));
  }
};

ADIT_COMPONENT(TunnelSimulatorComponent, "tunnel_simulator");

}  // namespace
}  // namespace adit
