#include <cmath>
#include <limits>
#include <map>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "bringup/offline/source.hpp"
#include "components/tunnel_simulator/scenario_loader.hpp"
#include "components/tunnel_simulator/sensor_messages.hpp"
#include "components/tunnel_simulator/simulation.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/camera_info.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/imu.hpp"
#include "sensor_msgs/msg/nav_sat_fix.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace adit::offline {
namespace {

namespace sim = tunnel_simulator;

class ScenarioSource final : public Source, private sim::Sink {
 public:
  ScenarioSource(std::unique_ptr<sim::Simulation> simulation, double duration_s, std::set<std::string> topics)
      : simulation_(std::move(simulation)), duration_s_(duration_s), topics_(std::move(topics)) {
    if (!heard("/tf_static")) return;
    auto rig = std::make_shared<tf2_msgs::msg::TFMessage>();
    sim::fill_rig(simulation_->scenario(), *rig);
    post(begin().time_since_epoch().count(), "/tf_static", std::move(rig));
  }

  Time begin() const override { return at(0.0); }
  Time end() const override { return at(duration_s_); }

  Result<bool> next(OfflineMessage& out) override {
    // A sample may arrive later than others that were measured after it: the first of the mail is due when the
    // simulation has passed its time.
    while (!over() && (mail_.empty() || Time(Duration(mail_.begin()->first)) > at(simulation_->ready()))) {
      simulation_->step(*this);
      if (!failure_.empty()) return Error{ErrorCode::internal, failure_};
    }
    if (mail_.empty()) return false;
    out = std::move(mail_.extract(mail_.begin()).mapped());
    return true;
  }

 private:
  bool over() const { return simulation_->ready() > duration_s_ + 1e-9; }
  bool heard(const char* topic) const { return topics_.contains(topic); }
  Time at(double seconds) const {
    return Time(Duration(std::llround((simulation_->scenario().epoch + seconds) * 1e9)));
  }

  template <class Message>
  void post(std::int64_t arrival_ns, const char* topic, std::shared_ptr<Message> message) {
    mail_.emplace(arrival_ns, offline_message<Message>(topic, Time(Duration(arrival_ns)), std::move(message)));
  }

  void on_lidar(const sim::LidarScan& scan, const sim::Delivery& delivery) override {
    if (!heard("/lidar/points")) return;
    auto message = std::make_shared<sensor_msgs::msg::PointCloud2>();
    if (auto filled = sim::fill(scan, delivery, *message); !filled) {
      failure_ = filled.error().message;
    } else {
      post(delivery.arrival_ns, "/lidar/points", std::move(message));
    }
  }
  void on_thermal(const sim::ThermalImage& image, const sim::Delivery& delivery) override {
    const sim::Scenario& scenario = simulation_->scenario();
    if (heard("/thermal/camera_info")) {  // first: who wants it needs it with the frame
      auto message = std::make_shared<sensor_msgs::msg::CameraInfo>();
      sim::fill_camera_info(delivery, scenario, *message);
      post(delivery.arrival_ns, "/thermal/camera_info", std::move(message));
    }
    if (heard("/thermal/frame")) {
      auto message = std::make_shared<adit_msgs::msg::ThermalFrame>();
      sim::fill(image, delivery, scenario, *message);
      post(delivery.arrival_ns, "/thermal/frame", std::move(message));
    }
    if (heard("/thermal/image_raw")) {
      auto message = std::make_shared<sensor_msgs::msg::Image>();
      sim::fill(image, delivery, scenario, *message);
      post(delivery.arrival_ns, "/thermal/image_raw", std::move(message));
    }
  }
  void on_imu(const sim::ImuSample& sample, const sim::Delivery& delivery) override {
    if (!heard("/imu")) return;
    auto message = std::make_shared<sensor_msgs::msg::Imu>();
    sim::fill(sample, simulation_->scenario().imu, *message);
    post(delivery.arrival_ns, "/imu", std::move(message));
  }
  void on_gnss(const sim::GnssSample& sample, const sim::Delivery& delivery) override {
    if (!heard("/gnss/fix")) return;
    auto message = std::make_shared<sensor_msgs::msg::NavSatFix>();
    sim::fill(sample, *message);
    post(delivery.arrival_ns, "/gnss/fix", std::move(message));
  }
  void on_truth(double time, const Pose&) override {
    if (!heard("/ground_truth/odometry")) return;
    auto message = std::make_shared<nav_msgs::msg::Odometry>();
    sim::fill_truth(*simulation_, time - simulation_->scenario().epoch, *message);
    post(std::llround(time * 1e9), "/ground_truth/odometry", std::move(message));
  }

  std::unique_ptr<sim::Simulation> simulation_;
  double duration_s_;
  std::set<std::string> topics_;
  std::multimap<std::int64_t, OfflineMessage> mail_;  // by arrival [ns]; equal arrivals keep their order
  std::string failure_;
};

}  // namespace

Result<std::unique_ptr<Source>> open_scenario(const std::string& path, const SourceOptions& options) {
  Result<sim::Scenario> scenario = sim::load_scenario(path);
  if (!scenario) return scenario.error();
  if (options.seed) scenario->seed = *options.seed;
  const auto heard = [&](const char* topic) { return options.topics.contains(topic); };
  scenario->lidar_on = scenario->lidar_on && heard("/lidar/points");
  scenario->thermal_on = scenario->thermal_on && (heard("/thermal/frame") || heard("/thermal/image_raw"));
  scenario->imu_on = scenario->imu_on && heard("/imu");
  scenario->gnss_on = scenario->gnss_on && heard("/gnss/fix");
  const double duration =
      options.duration_s > 0.0 ? std::min(options.duration_s, scenario->duration) : scenario->duration;
  auto simulation = sim::Simulation::create(*std::move(scenario), options.threads);
  if (!simulation) return simulation.error();
  return std::unique_ptr<Source>(new ScenarioSource(*std::move(simulation), duration, options.topics));
}

}  // namespace adit::offline
