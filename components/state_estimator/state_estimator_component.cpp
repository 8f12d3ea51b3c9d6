#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>

#include "adit_msgs/msg/fusion_status.hpp"
#include "adit_msgs/msg/localizability.hpp"
#include "adit_msgs/msg/thermal_health.hpp"
#include "components/geometry/rigid.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"
#include "components/state_estimator/component_doubt.hpp"
#include "components/state_estimator/component_messages.hpp"
#include "components/state_estimator/gnss_frame.hpp"
#include "components/state_estimator/state_estimator.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/imu.hpp"
#include "sensor_msgs/msg/nav_sat_fix.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace adit {
namespace {

using adit_msgs::msg::FusionStatus;
using adit_msgs::msg::Localizability;
using adit_msgs::msg::ThermalHealth;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::Imu;
using sensor_msgs::msg::NavSatFix;
using state_estimator::Estimate;
using state_estimator::StateEstimator;
using state_estimator::Verdict;
using tf2_msgs::msg::TFMessage;

enum class Preset { paper, predecessor, standard };
enum class OdometryFrame { sensor, level };
enum class Switch { preset, on, off };

std::int64_t nanoseconds(Time time) {
  return time.time_since_epoch().count();
}

// Fuses odometries and IMU; publishes pose, transform and status at its own rate, whatever arrives.
class StateEstimatorComponent final : public Component {
  using Numbers = std::vector<double>;
  inline static const Numbers identity{0, 0, 0, 0, 0, 0, 1};
  inline static const Choices<Switch> switches{{"preset", Switch::preset}, {"on", Switch::on}, {"off", Switch::off}};
  inline static const Choices<OdometryFrame> frames{{"sensor", OdometryFrame::sensor}, {"level", OdometryFrame::level}};

  Param<Preset> mode_{
      *this, "mode", Preset::standard,
      Choices<Preset>{{"paper", Preset::paper}, {"predecessor", Preset::predecessor}, {"default", Preset::standard}},
      "filter: the paper's, its predecessor's, or the consistent one"};
  Param<double> rate_{*this, "rate", 100.0, Unit::hertz, Range{1.0, 500.0}, "of the output"};
  Param<std::string> odom_frame_{*this, "odom_frame", std::string("odom"), "frame of the published poses"};
  Param<std::string> base_frame_{*this, "base_frame", std::string("base_link"), "the body"};
  Param<Numbers> lidar_pose_{*this, "lidar_pose", identity,
                             "of the LiDAR in base_frame: x y z [m], quaternion x y z w"};
  Param<Numbers> thermal_pose_{*this, "thermal_pose", identity, "of the thermal camera in base_frame"};
  Param<Numbers> imu_pose_{*this, "imu_pose", identity, "of the IMU in base_frame"};
  Param<OdometryFrame> lidar_frame_{
      *this, "lidar_frame", OdometryFrame::sensor, frames,
      "axes of the LiDAR odometry's frame: those of the sensor at its start, or level (z up)"};
  Param<OdometryFrame> thermal_frame_{*this, "thermal_frame", OdometryFrame::sensor, frames,
                                      "the same of the thermal odometry"};
  Param<bool> lidar_covariance_{
      *this, "lidar_covariance", true,
      "the LiDAR odometry's pose covariance is that of its last registration (false: one that accumulates; not used)"};
  Param<bool> thermal_covariance_{*this, "thermal_covariance", true, "the same of the thermal odometry"};
  Param<bool> use_imu_{*this, "use_imu", false, "fuse `imu`"};
  Param<bool> use_gnss_{*this, "use_gnss", false,
                        "fuse `fix`: after the first metres in the open, which show how odom lies on the Earth"};
  Param<Numbers> gnss_antenna_{*this, "gnss_antenna", Numbers{0, 0}, "of the antenna in base_frame: x y [m]"};
  Param<Numbers> gnss_origin_{
      *this, "gnss_origin", {}, "latitude, longitude [deg], altitude [m] of the local frame; empty: the first fix"};
  Param<double> gnss_baseline_{*this,       "gnss_baseline",    40.0,
                               Unit::metre, Range{5.0, 1000.0}, "driven with fixes before they are fused"};
  Param<Switch> relative_poses_{*this, "relative_poses", Switch::preset, switches,
                                "odometries are fused as relative poses (off: as speed and yaw rate)"};
  Param<Switch> thermal_calibration_{*this, "thermal_calibration", Switch::preset, switches,
                                     "estimate scale and yaw bias of the thermal odometry"};
  Param<Switch> gates_{*this, "gates", Switch::preset, switches, "chi-square gates and the disagreement test"};
  Param<Switch> adaptive_noise_{*this, "adaptive_noise", Switch::preset, switches,
                                "scale each odometry's covariance by what its innovations show"};
  // Of the vehicle; 0: the mode's own.
  Param<double> jerk_{*this, "jerk", 0.0, Range{0.0, 1e4}, "spectral density [m^2/s^5]; a car 10, a walking robot 300"};
  Param<double> yaw_jerk_{*this, "yaw_jerk", 0.0, Range{0.0, 1e4}, "the same of the heading [rad^2/s^5]; 0.03, 3000"};
  Param<double> slip_{*this, "slip", 0.0, Range{0.0, 10.0},
                      "motion that is not along the heading, density [m^2/s]: a walking robot sways, 1e-3"};
  Param<double> thermal_scale_sigma_{*this, "thermal_scale_sigma", 0.1, Range{1e-4, 10.0},
                                     "of ln(scale) at the start: 0.02 with LiDAR depth"};
  Param<double> thermal_delay_sigma_{
      *this,        "thermal_delay_sigma", 0.03,
      Unit::second, Range{0.0, 1.0},       "of the thermal stamps, one and the same for all; 0: they are right"};
  Param<double> lidar_anchor_period_{
      *this,        "lidar_anchor_period", 0.0,
      Unit::second, Range{0.0, 10.0},      "LiDAR poses are fused relative to one this old; 0: to the one before"};
  Param<double> lidar_position_floor_{*this,
                                      "lidar_position_floor",
                                      1e-5,
                                      Unit::metre,
                                      Range{1e-5, 10.0},
                                      "deviation of one LiDAR pose below which no reported covariance is believed"};
  Param<double> lidar_yaw_floor_{*this,        "lidar_yaw_floor", 1e-5,
                                 Unit::radian, Range{1e-6, 1.0},  "the same of its heading"};
  Param<double> thermal_position_floor_{*this,       "thermal_position_floor", 1e-5,
                                        Unit::metre, Range{1e-5, 10.0},        "the same of the thermal odometry"};
  Param<double> thermal_yaw_floor_{*this,        "thermal_yaw_floor", 1e-5,
                                   Unit::radian, Range{1e-6, 1.0},    "the same of its heading"};
  Param<Numbers> initial_pose_{*this, "initial_pose", Numbers{0, 0, 0}, "in odom_frame: x y [m], heading [rad]"};
  Param<Numbers> initial_pose_sigma_{*this,
                                     "initial_pose_sigma",
                                     {},
                                     "its deviations: of x and y [m], of the heading [rad]; empty: the mode's, small "
                                     "because the robot's own start defines odom_frame"};
  Param<double> initial_speed_{
      *this, "initial_speed", 0.0, Unit::metre_per_second, Range{-60.0, 60.0}, "when the first measurement comes"};
  Param<double> initial_speed_sigma_{
      *this, "initial_speed_sigma", 1.0, Unit::metre_per_second, Range{1e-3, 60.0}, "its deviation"};
  Param<double> silent_after_{*this,
                              "silent_after",
                              0.0,
                              Unit::second,
                              Range{0.0, 60.0},
                              "without a measured motion nothing is published: for a "
                              "prior, whose guess would be taken for news; 0: always"};
  Param<double> max_interval_{*this,        "max_interval",    0.5,
                              Unit::second, Range{0.01, 30.0}, "longer steps of an odometry are gaps"};

  Output<Odometry> odometry_{*this, "odometry", Qos::reliable(10)};
  Output<TFMessage> tf_{*this, "tf", Qos::reliable(100)};
  Output<FusionStatus> status_{*this, "status", Qos::reliable(10)};
  Input<Odometry> lidar_{*this, "lidar", Qos::reliable(10), Queue{10, WhenFull::drop_oldest},
                         [this](const Odometry& message, const MessageInfo&) { on_odometry(0, message); }};
  Input<Odometry> thermal_{*this, "thermal", Qos::reliable(10), Queue{30, WhenFull::drop_oldest},
                           [this](const Odometry& message, const MessageInfo&) { on_odometry(1, message); }};
  Input<Localizability> localizability_{
      *this, "localizability", Qos::reliable(10), Queue{10, WhenFull::drop_oldest},
      [this](const Localizability& message, const MessageInfo&) { lidar_doubt_.update(message); }};
  Input<ThermalHealth> thermal_health_{*this, "thermal_health", Qos::reliable(10), Queue{30, WhenFull::drop_oldest},
                                       [this](const ThermalHealth& message, const MessageInfo&) {
                                         thermal_doubt_ = state_estimator::doubt_of(message);
                                         const bool known = std::isfinite(message.scale_sigma);
                                         thermal_log_scale_sigma_.reset();
                                         if (known) thermal_log_scale_sigma_ = message.scale_sigma;
                                       }};
  Input<Imu> imu_{*this, "imu", Qos::sensor(), Queue{200, WhenFull::drop_oldest},
                  [this](const Imu& message, const MessageInfo&) { on_imu(message); }};
  Input<NavSatFix> fix_{*this, "fix", Qos::sensor(), Queue{20, WhenFull::drop_oldest},
                        [this](const NavSatFix& message, const MessageInfo&) { on_fix(message); }};
  Timer output_{*this, "output", std::chrono::milliseconds(10), [this](const TimerTick& tick) { on_tick(tick); }};

  state_estimator::Config config_;
  std::unique_ptr<StateEstimator> estimator_;
  std::array<Pose, 2> odometry_axes_;
  state_estimator::Arrivals arrivals_;
  state_estimator::LidarDoubt lidar_doubt_;
  state_estimator::Doubt thermal_doubt_;
  std::optional<double> thermal_log_scale_sigma_;  // of the frame before or this one
  std::optional<state_estimator::Geodetic> geodetic_origin_;
  std::optional<state_estimator::GnssFrame> gnss_frame_;
  std::int64_t last_output_ns_ = state_estimator::kNoStamp;
  double distance_ = 0.0;
  std::string reason_;

  Result<void> configure() override;
  Result<void> activate() override;
  Result<void> configure_start_and_gnss();
  void on_odometry(int sensor, const Odometry& message);
  void on_imu(const Imu& message);
  void on_fix(const NavSatFix& message);
  void note(std::size_t input, std::int64_t stamp_ns, std::int64_t head_ns, Verdict verdict);
  void on_tick(const TimerTick& tick);
  void publish(std::int64_t now);
  void publish_transform(const Odometry& message);
  void report(const Estimate& estimate, std::int64_t now);
};

Result<void> StateEstimatorComponent::configure() {
  using state_estimator::Config;
  config_ = mode_ == Preset::paper         ? Config::paper()
            : mode_ == Preset::predecessor ? Config::predecessor()
                                           : Config::standard();
  const Result<Pose> lidar = pose_from_numbers(lidar_pose_.value(), "lidar_pose"),
                     thermal = pose_from_numbers(thermal_pose_.value(), "thermal_pose"),
                     imu = pose_from_numbers(imu_pose_.value(), "imu_pose");
  for (const Result<Pose>* pose : {&lidar, &thermal, &imu}) {
    if (!*pose) return pose->error();
  }
  config_.odometries[0].odometry.body_from_sensor = *lidar;
  config_.odometries[1].odometry.body_from_sensor = *thermal;
  // A frame with the axes of the sensor at its start becomes the body's at its start, which is taken to be level.
  odometry_axes_ = {lidar_frame_ == OdometryFrame::sensor ? *lidar : Pose::Identity(),
                    thermal_frame_ == OdometryFrame::sensor ? *thermal : Pose::Identity()};
  for (auto& o : config_.odometries) {
    o.odometry.max_interval_s = max_interval_;
    if (relative_poses_ != Switch::preset) o.odometry.relative_pose = relative_poses_ == Switch::on;
  }
  config_.odometries[0].odometry.anchor_period_s = lidar_anchor_period_;
  config_.odometries[0].odometry.floor_position = lidar_position_floor_;
  config_.odometries[0].odometry.floor_yaw = lidar_yaw_floor_;
  config_.odometries[1].odometry.floor_position = thermal_position_floor_;
  config_.odometries[1].odometry.floor_yaw = thermal_yaw_floor_;
  if (thermal_calibration_ != Switch::preset) {
    const bool on = thermal_calibration_ == Switch::on;
    config_.odometries[1].odometry.calibration = {.scale = on, .yaw_bias = on, .delay = on};
  }
  config_.initial.sigma_scale = thermal_scale_sigma_;
  config_.initial.sigma_thermal_delay = thermal_delay_sigma_;
  if (adaptive_noise_ != Switch::preset) config_.adaptation.enabled = adaptive_noise_ == Switch::on;
  if (jerk_ > 0.0) config_.process.noise.jerk = jerk_;
  if (yaw_jerk_ > 0.0) config_.process.noise.yaw_jerk = yaw_jerk_;
  if (slip_ > 0.0) config_.process.noise.position = slip_;
  if (gates_ != Switch::preset) config_.gate.enabled = config_.disagreement.enabled = gates_ == Switch::on;
  config_.imu.enabled = use_imu_;
  config_.imu.body_from_sensor = *imu;
  if (Result<void> fine = configure_start_and_gnss(); !fine) return fine;
  config_.outage_s = std::max(config_.outage_s, max_interval_.value());
  config_.replay.history_s = std::max(config_.replay.history_s, 2.0 * max_interval_);
  config_.clock_jump_s = 0.2;  // this clock's readings are in order: what goes back is a step
  if (Result<void> valid = state_estimator::check(config_); !valid) return valid;
  output_.set_period(Duration(static_cast<Duration::rep>(1e9 / rate_)));
  return {};
}

Result<void> StateEstimatorComponent::configure_start_and_gnss() {
  const auto numbers = [](const Param<Numbers>& param, std::size_t count, const char* what) -> Result<void> {
    const bool finite =
        std::all_of(param.value().begin(), param.value().end(), [](double v) { return std::isfinite(v); });
    if (finite && param.value().size() == count) return {};
    return Error{ErrorCode::invalid_argument, param.name() + ": expected " + what};
  };
  if (Result<void> fine = numbers(initial_pose_, 3, "x y heading"); !fine) return fine;
  if (!initial_pose_sigma_.value().empty()) {
    if (Result<void> fine = numbers(initial_pose_sigma_, 2, "position heading"); !fine) return fine;
    config_.initial.sigma_position = initial_pose_sigma_.value()[0];
    config_.initial.sigma_yaw = initial_pose_sigma_.value()[1];
  }
  if (Result<void> fine = numbers(gnss_antenna_, 2, "x y"); !fine) return fine;
  geodetic_origin_.reset();
  if (!gnss_origin_.value().empty()) {
    if (Result<void> fine = numbers(gnss_origin_, 3, "latitude longitude altitude"); !fine) return fine;
    geodetic_origin_ = {gnss_origin_.value()[0], gnss_origin_.value()[1], gnss_origin_.value()[2]};
  }
  config_.initial.x = initial_pose_.value()[0];
  config_.initial.y = initial_pose_.value()[1];
  config_.initial.yaw = initial_pose_.value()[2];
  config_.initial.speed = initial_speed_;
  config_.initial.sigma_speed = initial_speed_sigma_;
  config_.gnss.enabled = config_.gnss.enabled || use_gnss_;
  config_.gnss.lever_arm = {gnss_antenna_.value()[0], gnss_antenna_.value()[1]};
  return {};
}

Result<void> StateEstimatorComponent::activate() {
  Result<std::unique_ptr<StateEstimator>> made = StateEstimator::create(config_);
  if (!made) return made.error();
  estimator_ = std::move(*made);
  arrivals_ = {};
  lidar_doubt_ = {};
  thermal_doubt_ = {};
  thermal_log_scale_sigma_.reset();
  gnss_frame_.emplace(state_estimator::GnssFrame::Config{.baseline_m = gnss_baseline_});
  last_output_ns_ = state_estimator::kNoStamp;
  distance_ = 0.0;
  reason_.clear();
  // Simulated time that nobody has set yet is no start: the first measurement is.
  const std::int64_t now = nanoseconds(clock().now());
  if (now > 0) estimator_->start(now);
  return {};
}

void StateEstimatorComponent::on_odometry(int sensor, const Odometry& message) {
  const auto index = static_cast<std::size_t>(sensor);
  const auto& p = message.pose.pose.position;
  const auto& q = message.pose.pose.orientation;
  const Eigen::Quaterniond rotation(q.w, q.x, q.y, q.z);
  const bool unit = std::abs(rotation.norm() - 1.0) < 0.01;  // false for NaN
  Pose pose = Pose::Identity();
  pose.translation() = Eigen::Vector3d(p.x, p.y, p.z);
  if (unit) {
    pose.linear() = rotation.normalized().toRotationMatrix();
  } else {
    pose.translation().setConstant(std::nan(""));  // counted as malformed
  }
  state_estimator::OdometrySample sample;
  sample.stamp_ns = nanoseconds(to_time(message.header.stamp));
  sample.pose = odometry_axes_[index] * pose;
  sample.frame = std::hash<std::string>{}(message.header.frame_id);
  const bool use_covariance = sensor == 0 ? lidar_covariance_ : thermal_covariance_;
  if (use_covariance && unit) sample.information = state_estimator::reported_information(message, pose.linear());
  sample.suspicion = (sensor == 0 ? lidar_doubt_.doubt() : thermal_doubt_).at(sample.stamp_ns);
  if (sensor == 1) sample.log_scale_sigma = thermal_log_scale_sigma_;
  const std::int64_t head = estimator_->state().stamp_ns;
  note(index, sample.stamp_ns, head, estimator_->add_odometry(sensor, sample, nanoseconds(clock().now())));
}

void StateEstimatorComponent::on_imu(const Imu& message) {
  if (!use_imu_) return;
  const auto& w = message.angular_velocity;
  const auto& a = message.linear_acceleration;
  state_estimator::ImuSample sample;
  sample.stamp_ns = nanoseconds(to_time(message.header.stamp));
  sample.angular_rate = {w.x, w.y, w.z};
  sample.specific_force = {a.x, a.y, a.z};
  const std::int64_t head = estimator_->state().stamp_ns;
  note(2, sample.stamp_ns, head, estimator_->add_imu(sample, nanoseconds(clock().now())));
}

void StateEstimatorComponent::on_fix(const NavSatFix& message) {
  if (!config_.gnss.enabled) return;
  const auto& c = message.position_covariance;
  const bool fixed = message.status.status >= 0 && message.position_covariance_type != 0 &&
                     std::isfinite(message.latitude) && std::isfinite(message.longitude) &&
                     std::isfinite(message.altitude);
  if (!fixed) return;
  const state_estimator::Geodetic place{message.latitude, message.longitude, message.altitude};
  if (!geodetic_origin_) geodetic_origin_ = place;
  const Eigen::Vector2d local = state_estimator::to_local(*geodetic_origin_, place).head<2>();
  const Eigen::Matrix2d covariance = (Eigen::Matrix2d() << c[0], c[1], c[3], c[4]).finished();
  state_estimator::GnssSample sample;
  sample.stamp_ns = nanoseconds(to_time(message.header.stamp));
  if (!gnss_frame_->aligned()) {
    const std::optional<Estimate> then = estimator_->estimate(sample.stamp_ns);
    if (!then) return;
    const Eigen::Vector3d arm(config_.gnss.lever_arm.x(), config_.gnss.lever_arm.y(), 0.0);
    const double sigma = std::sqrt(std::max(covariance(0, 0), covariance(1, 1)));
    if (gnss_frame_->add(local, sigma, (then->pose * arm).head<2>())) {
      log().info("odom's x axis lies {:.2f} degrees left of east", gnss_frame_->heading() * 180.0 / M_PI);
    }
    return;
  }
  const state_estimator::GnssFrame::Fix fix = gnss_frame_->to_odom(local, covariance);
  sample.position = fix.position;
  sample.covariance = fix.covariance;
  const std::int64_t head = estimator_->state().stamp_ns;
  note(3, sample.stamp_ns, head, estimator_->add_gnss(sample, nanoseconds(clock().now())));
}

void StateEstimatorComponent::note(std::size_t input, std::int64_t stamp_ns, std::int64_t head_ns, Verdict verdict) {
  arrivals_[input].last_ns = nanoseconds(clock().now());
  if (verdict == Verdict::fused && stamp_ns < head_ns) ++arrivals_[input].late;
}

// Simulated time comes in steps that may be longer than a period: what was due in between is published too.
void StateEstimatorComponent::on_tick(const TimerTick& tick) {
  constexpr std::uint64_t most = 50;
  const std::int64_t period = output_.period().count();
  const std::uint64_t before = clock().simulated() ? std::min(tick.missed, most) : 0;
  for (std::uint64_t i = before; i > 0; --i) {
    publish(nanoseconds(tick.scheduled) - static_cast<std::int64_t>(i) * period);
  }
  publish(nanoseconds(clock().simulated() ? tick.scheduled : tick.now));
}

void StateEstimatorComponent::publish(std::int64_t now) {
  const std::optional<Estimate> estimate = estimator_->publish(now);
  if (!estimate) return;
  const std::int64_t measured = estimator_->state().last_motion_ns;
  const bool unknown =
      measured == state_estimator::kNoStamp || state_estimator::seconds_between(measured, now) > silent_after_;
  if (silent_after_ > 0.0 && unknown) return;
  const double step =
      last_output_ns_ == state_estimator::kNoStamp ? 0.0 : state_estimator::seconds_between(last_output_ns_, now);
  distance_ += std::abs(estimate->speed) * std::clamp(step, 0.0, 1.0);
  last_output_ns_ = now;

  Loan<Odometry> message = odometry_.loan();
  message->header.stamp = to_stamp(Time(Duration(now)));
  message->header.frame_id = odom_frame_.value();
  message->child_frame_id = base_frame_.value();
  state_estimator::fill(*estimate, *message);
  if (tf_.has_readers()) publish_transform(*message);
  odometry_.publish(std::move(message));
  report(*estimate, now);
}

void StateEstimatorComponent::publish_transform(const Odometry& message) {
  Loan<TFMessage> tf = tf_.loan();
  tf->transforms.resize(1);
  auto& transform = tf->transforms.front();
  transform.header = message.header;
  transform.child_frame_id = message.child_frame_id;
  const auto& p = message.pose.pose.position;
  transform.transform.translation = {p.x, p.y, p.z};
  transform.transform.rotation = message.pose.pose.orientation;
  tf_.publish(std::move(tf));
}

void StateEstimatorComponent::report(const Estimate& estimate, std::int64_t now) {
  using state_estimator::Mode;
  const state_estimator::Status status = estimator_->status(now);
  const bool began = state_estimator::began(status);
  std::string reason = began ? to_string(status.mode) : "nothing measured yet";
  if (status.conflict) reason += ", sensors contradict each other";
  if (status.clock_jumps > 0) reason += ", " + std::to_string(status.clock_jumps) + " clock jumps";
  if (reason != reason_) {
    reason_ = reason;
    health(status.mode == Mode::fused && !status.conflict ? Health::ok : Health::warn, std::move(reason));
  }
  if (!status_.has_readers()) return;
  Loan<FusionStatus> message = status_.loan();
  message->header.stamp = to_stamp(Time(Duration(now)));
  message->header.frame_id = odom_frame_.value();
  message->distance = distance_;
  state_estimator::fill(estimate, status, arrivals_, config_, now, *message);
  status_.publish(std::move(message));
}

ADIT_COMPONENT(StateEstimatorComponent, "state_estimator");

}  // namespace
}  // namespace adit
