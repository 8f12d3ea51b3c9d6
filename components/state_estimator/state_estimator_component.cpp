#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>

#include "adit_msgs/msg/fusion_status.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"
#include "components/state_estimator/correction.hpp"
#include "components/state_estimator/gnss_frame.hpp"
#include "components/state_estimator/state_estimator.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/imu.hpp"
#include "sensor_msgs/msg/nav_sat_fix.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace adit {
namespace {

using adit_msgs::msg::FusionStatus;
using adit_msgs::msg::SensorStatus;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::Imu;
using sensor_msgs::msg::NavSatFix;
using state_estimator::Estimate;
using state_estimator::SensorReport;
using state_estimator::StateEstimator;
using state_estimator::Verdict;
using tf2_msgs::msg::TFMessage;

enum class Preset { paper, predecessor, standard };
enum class OdometryFrame { sensor, level };

constexpr double not_estimated = 1e6;  // variance of height, roll and pitch: they are carried along, not filtered

std::int64_t nanoseconds(Time time) {
  return time.time_since_epoch().count();
}

// Fuses odometries and IMU; publishes pose, transform and status at its own rate, whatever arrives.
class StateEstimatorComponent final : public Component {
  using Numbers = std::vector<double>;
  inline static const Numbers identity{0, 0, 0, 0, 0, 0, 1};
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
  Param<Numbers> initial_pose_{*this, "initial_pose", Numbers{0, 0, 0}, "in odom_frame: x y [m], heading [rad]"};
  Param<double> initial_speed_{
      *this, "initial_speed", 0.0, Unit::metre_per_second, Range{-60.0, 60.0}, "when the first measurement comes"};
  Param<double> initial_speed_sigma_{
      *this, "initial_speed_sigma", 1.0, Unit::metre_per_second, Range{1e-3, 60.0}, "its deviation"};
  Param<double> max_interval_{*this,        "max_interval",    0.5,
                              Unit::second, Range{0.01, 30.0}, "longer steps of an odometry are gaps"};

  Output<Odometry> odometry_{*this, "odometry", Qos::reliable(10)};
  Output<TFMessage> tf_{*this, "tf", Qos::reliable(100)};
  Output<FusionStatus> status_{*this, "status", Qos::reliable(10)};
  Input<Odometry> lidar_{*this, "lidar", Qos::reliable(10), Queue{10, WhenFull::drop_oldest},
                         [this](const Odometry& message, const MessageInfo&) { on_odometry(0, message); }};
  Input<Odometry> thermal_{*this, "thermal", Qos::reliable(10), Queue{30, WhenFull::drop_oldest},
                           [this](const Odometry& message, const MessageInfo&) { on_odometry(1, message); }};
  Input<Imu> imu_{*this, "imu", Qos::sensor(), Queue{200, WhenFull::drop_oldest},
                  [this](const Imu& message, const MessageInfo&) { on_imu(message); }};
  Input<NavSatFix> fix_{*this, "fix", Qos::sensor(), Queue{20, WhenFull::drop_oldest},
                        [this](const NavSatFix& message, const MessageInfo&) { on_fix(message); }};
  Timer output_{*this, "output", std::chrono::milliseconds(10), [this](const TimerTick& tick) { on_tick(tick); }};

  // What the estimator does not keep of an input: lidar, thermal, imu, gnss.
  struct Arrivals {
    std::int64_t last_ns = state_estimator::kNoStamp;
    std::uint64_t late = 0;
  };

  state_estimator::Config config_;
  std::unique_ptr<StateEstimator> estimator_;
  std::array<Pose, 2> odometry_axes_;
  std::array<Arrivals, 4> arrivals_;
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
  void fill(const SensorReport& report, std::size_t input, std::int64_t now, SensorStatus& out) const;
};

Result<Pose> pose_of(const Param<std::vector<double>>& param) {
  const std::vector<double>& v = param.value();
  if (v.size() != 7) {
    return Error{ErrorCode::invalid_argument, param.name() + ": 7 numbers are wanted: x y z qx qy qz qw"};
  }
  const bool finite = Eigen::Map<const Eigen::Matrix<double, 7, 1>>(v.data()).allFinite();
  const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
  if (!finite || !(std::abs(q.norm() - 1.0) < 0.01)) {
    return Error{ErrorCode::invalid_argument, param.name() + ": not finite, or the quaternion's norm is not 1"};
  }
  Pose pose = Pose::Identity();
  pose.linear() = q.normalized().toRotationMatrix();
  pose.translation() = Eigen::Vector3d(v[0], v[1], v[2]);
  return pose;
}

// nav_msgs/Odometry has the covariance about the axes of the parent frame; the estimator takes the information of the
// right perturbation. All zero means unknown; what is no covariance is not used either.
std::optional<Matrix6d> reported_information(const Odometry& message, const Eigen::Matrix3d& rotation) {
  const Matrix6d covariance =
      Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(message.pose.covariance.data());
  if (!covariance.allFinite()) return std::nullopt;
  Matrix6d to_sensor = Matrix6d::Zero();
  to_sensor.topLeftCorner<3, 3>() = to_sensor.bottomRightCorner<3, 3>() = rotation.transpose();
  return state_estimator::information_from_covariance(to_sensor * covariance * to_sensor.transpose());
}

Result<void> StateEstimatorComponent::configure() {
  using state_estimator::Config;
  config_ = mode_ == Preset::paper         ? Config::paper()
            : mode_ == Preset::predecessor ? Config::predecessor()
                                           : Config::standard();
  const Result<Pose> lidar = pose_of(lidar_pose_), thermal = pose_of(thermal_pose_), imu = pose_of(imu_pose_);
  for (const Result<Pose>* pose : {&lidar, &thermal, &imu}) {
    if (!*pose) return pose->error();
  }
  config_.odometries[0].odometry.body_from_sensor = *lidar;
  config_.odometries[1].odometry.body_from_sensor = *thermal;
  // A frame with the axes of the sensor at its start becomes the body's at its start, which is taken to be level.
  odometry_axes_ = {lidar_frame_ == OdometryFrame::sensor ? *lidar : Pose::Identity(),
                    thermal_frame_ == OdometryFrame::sensor ? *thermal : Pose::Identity()};
  for (auto& o : config_.odometries) o.odometry.max_interval_s = max_interval_;
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
  if (use_covariance && unit) sample.information = reported_information(message, pose.linear());
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
  const double step =
      last_output_ns_ == state_estimator::kNoStamp ? 0.0 : state_estimator::seconds_between(last_output_ns_, now);
  distance_ += std::abs(estimate->speed) * std::clamp(step, 0.0, 1.0);
  last_output_ns_ = now;

  const Eigen::Quaterniond q(estimate->pose.linear());
  const Eigen::Vector3d t = estimate->pose.translation();
  Loan<Odometry> message = odometry_.loan();
  message->header.stamp = to_stamp(Time(Duration(now)));
  message->header.frame_id = odom_frame_.value();
  message->child_frame_id = base_frame_.value();
  message->pose.pose.position = {t.x(), t.y(), t.z()};
  message->pose.pose.orientation = {q.x(), q.y(), q.z(), q.w()};
  message->twist.twist.linear = {estimate->speed, 0.0, 0.0};
  message->twist.twist.angular = {0.0, 0.0, estimate->yaw_rate};
  message->pose.covariance.fill(0.0);
  message->twist.covariance.fill(0.0);
  for (const std::size_t i : {2, 3, 4}) message->pose.covariance[7 * i] = not_estimated;
  for (const std::size_t i : {1, 2, 3, 4}) message->twist.covariance[7 * i] = not_estimated;
  constexpr std::size_t planar[3] = {0, 1, 5};
  constexpr std::size_t motion[2] = {0, 5};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) message->pose.covariance[6 * planar[i] + planar[j]] = estimate->pose_covariance(i, j);
  }
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) message->twist.covariance[6 * motion[i] + motion[j]] = estimate->twist_covariance(i, j);
  }
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

void StateEstimatorComponent::fill(const SensorReport& report, std::size_t input, std::int64_t now,
                                   SensorStatus& out) const {
  using state_estimator::chi_square;
  using state_estimator::Quantile;
  const Arrivals& arrivals = arrivals_[input];
  const bool arrives = arrivals.last_ns != state_estimator::kNoStamp &&
                       state_estimator::seconds_between(arrivals.last_ns, now) <= config_.outage_s;
  out.name = report.name;
  out.health = !arrives            ? SensorStatus::ABSENT
               : report.distrusted ? SensorStatus::FAULTY
               : report.healthy    ? SensorStatus::HEALTHY
                                   : SensorStatus::DEGRADED;
  out.reason = !arrives            ? "no data"
               : report.distrusted ? "contradicted by another sensor"
               : report.healthy    ? ""
                                   : "its data is not fused";
  out.age = report.age_s;
  out.nis = report.nis;
  out.nis_mean = report.mean_nis_per_dof;
  out.degrees_of_freedom = static_cast<std::uint8_t>(report.nis_dof);
  const bool gated = config_.gate.enabled && report.nis_dof > 0;
  out.gate = gated ? chi_square(report.nis_dof, Quantile::p99_9) : 0.0;
  out.weight = report.healthy ? 1.0 : 0.0;
  if (gated && report.healthy) {
    const double certain = chi_square(report.nis_dof, Quantile::p95);
    if (report.nis > out.gate) {
      out.weight = 0.0;
    } else if (config_.gate.robust && report.nis > certain) {
      out.weight = std::sqrt(certain / report.nis);
    }
  }
  out.accepted = report.accepted;
  out.rejected = report.rejected + report.distrusted_count;
  out.late = arrivals.late;
  out.dropped = report.too_old + report.duplicates + report.future + report.malformed + report.gaps + report.jumps;
}

void StateEstimatorComponent::report(const Estimate& estimate, std::int64_t now) {
  using state_estimator::Mode;
  const state_estimator::Status s = estimator_->status(now);
  const bool began =
      std::any_of(s.sensors.begin(), s.sensors.end(), [](const SensorReport& r) { return r.age_s >= 0; });
  std::string reason = began ? to_string(s.mode) : "nothing measured yet";
  if (s.conflict) reason += ", sensors contradict each other";
  if (s.clock_jumps > 0) reason += ", " + std::to_string(s.clock_jumps) + " clock jumps";
  if (reason != reason_) {
    reason_ = reason;
    health(s.mode == Mode::fused && !s.conflict ? Health::ok : Health::warn, std::move(reason));
  }
  if (!status_.has_readers()) return;

  Loan<FusionStatus> message = status_.loan();
  message->header.stamp = to_stamp(Time(Duration(now)));
  message->header.frame_id = odom_frame_.value();
  message->mode = !began                    ? FusionStatus::MODE_INITIALIZING
                  : s.mode == Mode::fused   ? FusionStatus::MODE_FUSED
                  : s.mode == Mode::lidar   ? FusionStatus::MODE_LIDAR
                  : s.mode == Mode::thermal ? FusionStatus::MODE_THERMAL
                                            : FusionStatus::MODE_DEAD_RECKONING;
  message->thermal_scale = s.thermal_scale;
  message->thermal_scale_sigma = s.thermal_scale_sigma;
  message->replays = s.replays;
  message->distance = distance_;
  const double heading = yaw(estimate.pose.linear());
  const Eigen::Vector2d ahead(std::cos(heading), std::sin(heading)), left(-ahead.y(), ahead.x());
  const Eigen::Matrix2d p = estimate.pose_covariance.topLeftCorner<2, 2>();
  message->along_track_sigma = std::sqrt(std::max(0.0, ahead.dot(p * ahead)));
  message->cross_track_sigma = std::sqrt(std::max(0.0, left.dot(p * left)));
  message->yaw_sigma = std::sqrt(std::max(0.0, estimate.pose_covariance(2, 2)));
  message->stationary = false;
  message->sensors.clear();
  for (const SensorReport& r : s.sensors) {
    if (r.name == "zero_velocity") message->stationary = r.age_s >= 0.0 && r.age_s < 0.3;
    constexpr std::array<std::string_view, 4> inputs{"lidar", "thermal", "imu", "gnss"};
    const auto input = std::find(inputs.begin(), inputs.end(), r.name);
    if (input == inputs.end()) continue;
    fill(r, static_cast<std::size_t>(input - inputs.begin()), now, message->sensors.emplace_back());
  }
  status_.publish(std::move(message));
}

ADIT_COMPONENT(StateEstimatorComponent, "state_estimator");

}  // namespace
}  // namespace adit
