#include <algorithm>
#include <deque>
#include <numbers>

#include "adit_msgs/msg/localizability.hpp"
#include "components/geometry/rigid.hpp"
#include "components/geometry/trajectory.hpp"
#include "components/lidar_odometry/config.hpp"
#include "components/lidar_odometry/inertial_predictor.hpp"
#include "components/lidar_odometry/lidar_odometry.hpp"
#include "components/lidar_odometry/motion_prior.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"
#include "idl/point_cloud_view.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/imu.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit {
namespace {

using lidar_odometry::Direction;
using lidar_odometry::Mode;
using nav_msgs::msg::Odometry;
using LocalizabilityMessage = adit_msgs::msg::Localizability;
using sensor_msgs::msg::Imu;
using sensor_msgs::msg::PointCloud2;

constexpr std::int64_t imu_silence_ns = 500'000'000;  // then no cloud waits for the IMU

// What `prior` is. guess: recorded poses of the sensor at the instants of the clouds, which wait for them; the
// registration starts there and does not lean on them. pose, velocity: a live odometry; its poses' differences, or its
// velocities, are weighed against the match. No cloud waits for it.
enum class PriorKind { guess, pose, velocity };

class LidarOdometryComponent final : public Component {
  using CloudPointer = std::shared_ptr<const PointCloud2>;

  Param<Mode> mode_{*this, "mode", Mode::default_,
                    Choices<Mode>{{"kiss", Mode::kiss}, {"genz", Mode::genz}, {"default", Mode::default_}},
                    "algorithm"};
  Param<double> min_range_{*this, "min_range", 0.5, Unit::metre, Range{0.0, 100.0}, "nearer points are dropped"};
  Param<double> max_range_{*this, "max_range", 100.0, Unit::metre, Range{1.0, 500.0}, "farther points are dropped"};
  Param<double> voxel_size_{*this,       "voxel_size",     0.0,
                            Unit::metre, Range{0.0, 10.0}, "of the local map; 0: the mode's default"};
  Param<bool> deskew_{*this, "deskew", true, "compensate the motion within the sweep"};
  Param<std::int64_t> threads_{*this, "threads", 1, Range{1.0, 16.0}, "the result does not depend on it"};
  Param<std::string> odom_frame_{*this, "odom_frame", std::string("odom"), "frame of the published poses"};
  Param<double> max_acceleration_{*this,
                                  "max_acceleration",
                                  3.0,
                                  Unit::metre_per_second_squared,
                                  Range{0.1, 1000.0},
                                  "of the vehicle; too large is safe, too small lags"};
  Param<double> max_angular_acceleration_{*this, "max_angular_acceleration", 1.0, Range{0.1, 1000.0},
                                          "rad/s^2; a walking robot: 20"};
  Param<double> deskew_share_{*this, "deskew_share", 0.7, Range{0.0, 1.0},
                              "of the estimated motion in the compensation; a walking robot: 0.5"};
  Param<bool> use_prior_{*this, "use_prior", false, "use the odometry that arrives at `prior`"};
  Param<PriorKind> prior_kind_{
      *this, "prior_kind", PriorKind::guess,
      Choices<PriorKind>{{"guess", PriorKind::guess}, {"pose", PriorKind::pose}, {"velocity", PriorKind::velocity}},
      "guess: poses at the stamps of the clouds, to start from; pose, velocity: live odometry, weighed by its "
      "covariance"};
  Param<double> prior_timeout_{*this,        "prior_timeout",   1.0,
                               Unit::second, Range{0.01, 60.0}, "kind guess: a cloud waits this long for its prior"};
  Param<bool> use_imu_{*this, "use_imu", false, "motion within and between sweeps from the IMU at `imu`"};
  Param<std::vector<double>> imu_pose_{*this, "imu_pose", std::vector<double>{0, 0, 0, 0, 0, 0, 1},
                                       "of the IMU in the same frame as lidar_pose: x y z [m], x y z w"};
  Param<double> imu_timeout_{*this,        "imu_timeout",    0.1,
                             Unit::second, Range{0.0, 10.0}, "a cloud waits this long for the IMU's last sample"};
  Param<std::vector<double>> lidar_pose_{*this, "lidar_pose", std::vector<double>{0, 0, 0, 0, 0, 0, 1},
                                         "of the LiDAR in base_link: x y z [m], x y z w"};
  Param<double> prior_velocity_sigma_{
      *this, "prior_velocity_sigma", 0.0, Unit::metre_per_second, Range{0.0, 100.0}, "0: the covariance of its twist"};
  Param<double> prior_rate_sigma_{
      *this, "prior_rate_sigma", 0.0, Unit::radian_per_second, Range{0.0, 10.0}, "0: the covariance of its twist"};

  Output<Odometry> odometry_{*this, "odometry", Qos::reliable(10)};
  Output<LocalizabilityMessage> localizability_{*this, "localizability", Qos::reliable(10)};
  Input<PointCloud2> points_{*this, "points", Qos::sensor(), Queue{2, WhenFull::drop_oldest},
                             [this](CloudPointer cloud, const MessageInfo&) { on_cloud(std::move(cloud)); }};
  Input<Odometry> prior_{*this, "prior", Qos::reliable(100), Queue{100, WhenFull::drop_oldest},
                         [this](const Odometry& message, const MessageInfo&) { on_prior(message); }};
  Input<Imu> imu_{*this, "imu", Qos::sensor(), Queue{500, WhenFull::drop_oldest},
                  [this](const Imu& message, const MessageInfo&) { on_imu(message); }};
  Timer overdue_{*this, "overdue", std::chrono::milliseconds(100), [this] { process_waiting(); }};

  // A cloud that may wait for the prior of its instant and for the IMU's samples. `cloud` and `stamps` of the first one
  // only: it is the one in the buffers.
  struct Waiting {
    CloudPointer message;
    Time arrived;
    bool late = false;  // has waited long enough
    std::optional<lidar_odometry::Cloud> cloud;
    lidar_odometry::SweepStamps stamps{};
  };
  static constexpr std::size_t max_waiting = 8;
  static constexpr std::size_t max_priors = 1000;

  std::optional<lidar_odometry::LidarOdometry> engine_;
  std::vector<lidar_odometry::Point3f> points_buffer_;
  std::vector<float> seconds_buffer_;
  std::vector<std::uint16_t> rings_buffer_;
  std::deque<Waiting> waiting_;
  Trajectory priors_;
  std::optional<Pose> prior_at_last_;  // its pose at the instant of the last estimate
  lidar_odometry::MotionPrior motion_;
  std::optional<std::int64_t> last_ns_;  // instant of the last estimate
  std::uint64_t refused_ = 0;
  std::uint64_t without_prior_ = 0;
  lidar_odometry::InertialPredictor inertial_;
  std::uint64_t without_imu_ = 0;
  bool imu_missing_ = false;  // for the last cloud

  Result<void> configure() override;
  Result<void> activate() override;
  Result<void> deactivate() override;
  void on_time_jump(Duration) override;
  void on_cloud(CloudPointer cloud);
  void on_prior(const Odometry& message);
  void on_imu(const Imu& message);
  void process_waiting();
  bool complete(const Waiting& waiting) const;
  std::optional<lidar_odometry::Prior> prior_for(std::int64_t instant_ns, const std::optional<Pose>& guess) const;
  Result<lidar_odometry::Cloud> view(const PointCloud2& message);
  void process(const Waiting& waiting);
  void publish(const lidar_odometry::Estimate& estimate, const std::string& frame_id);
  void publish_localizability(const lidar_odometry::Estimate& estimate, const std::string& frame_id);
  void report(const lidar_odometry::Estimate& estimate);
};

Result<void> LidarOdometryComponent::configure() {
  lidar_odometry::Config config;
  config.mode = mode_;
  config.min_range = min_range_;
  config.max_range = max_range_;
  config.deskew = deskew_;
  config.surfel.max_acceleration = max_acceleration_;
  config.surfel.max_angular_acceleration = max_angular_acceleration_;
  config.surfel.deskew_share = deskew_share_;
  config.threads = static_cast<int>(threads_.value());
  if (voxel_size_ > 0.0) config.kiss.voxel_size = config.genz.voxel_size = voxel_size_;
  if (Result<void> valid = lidar_odometry::check(config); !valid) return valid;
  const Result<Pose> sensor = pose_from_numbers(lidar_pose_.value(), "lidar_pose");
  if (!sensor) return sensor.error();
  const Result<Pose> imu = pose_from_numbers(imu_pose_.value(), "imu_pose");
  if (!imu) return imu.error();
  inertial_ = lidar_odometry::InertialPredictor({.lidar_from_imu = sensor->inverse() * *imu});
  engine_.emplace(config);
  motion_ = lidar_odometry::MotionPrior({.sensor = *sensor,
                                         .differences = prior_kind_ == PriorKind::pose,
                                         .velocity_sigma = prior_velocity_sigma_,
                                         .rate_sigma = prior_rate_sigma_});
  return {};
}

Result<void> LidarOdometryComponent::activate() {
  on_time_jump({});
  refused_ = without_prior_ = without_imu_ = 0;
  return {};
}

// The last clouds go without what did not come.
Result<void> LidarOdometryComponent::deactivate() {
  for (Waiting& waiting : waiting_) waiting.late = true;
  process_waiting();
  return {};
}

void LidarOdometryComponent::on_time_jump(Duration) {
  engine_->reset();
  waiting_.clear();
  priors_.clear();
  prior_at_last_.reset();
  motion_.clear();
  inertial_.clear();
  last_ns_.reset();
}

void LidarOdometryComponent::on_cloud(CloudPointer cloud) {
  if (waiting_.size() == max_waiting) {
    waiting_.front().late = true;
    process_waiting();
  }
  waiting_.push_back({.message = std::move(cloud), .arrived = clock().now(), .cloud = std::nullopt});
  process_waiting();
}

void LidarOdometryComponent::on_imu(const Imu& message) {
  if (!use_imu_) return;
  const auto& w = message.angular_velocity;
  const auto& a = message.linear_acceleration;
  inertial_.add({.stamp_ns = to_time(message.header.stamp).time_since_epoch().count(),
                 .rate = {w.x, w.y, w.z},
                 .acceleration = {a.x, a.y, a.z}});
  process_waiting();
}

void LidarOdometryComponent::on_prior(const Odometry& message) {
  const auto& p = message.pose.pose.position;
  const auto& q = message.pose.pose.orientation;
  const auto& v = message.twist.twist;
  const Eigen::Quaterniond rotation(q.w, q.x, q.y, q.z);
  if (!use_prior_ || !(std::abs(rotation.norm() - 1.0) < 0.01)) return;
  lidar_odometry::MotionSample sample;
  sample.stamp_ns = to_time(message.header.stamp).time_since_epoch().count();
  sample.pose.translation() = Eigen::Vector3d(p.x, p.y, p.z);
  sample.pose.linear() = rotation.normalized().toRotationMatrix();
  if (prior_kind_ != PriorKind::guess) {
    sample.twist << v.linear.x, v.linear.y, v.linear.z, v.angular.x, v.angular.y, v.angular.z;
    sample.twist_covariance =
        Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(message.twist.covariance.data());
    motion_.add(sample);
    return;
  }
  if (!sample.pose.translation().allFinite()) return;
  if (!priors_.empty() && sample.stamp_ns <= priors_.back().stamp_ns) return;
  if (priors_.size() == max_priors) priors_.erase(priors_.begin(), priors_.begin() + max_priors / 2);
  priors_.push_back({sample.stamp_ns, sample.pose});
  process_waiting();
}

// Has what it may wait for, or has waited long enough. An IMU that has been silent for long is not waited for.
bool LidarOdometryComponent::complete(const Waiting& waiting) const {
  if (waiting.late) return true;
  const auto waited = [&](Time since, double timeout) {
    return std::chrono::duration<double>(clock().now() - since).count() >= timeout;
  };
  if (use_prior_ && prior_kind_ == PriorKind::guess) {
    const std::int64_t stamp = to_time(waiting.message->header.stamp).time_since_epoch().count();
    const bool known = !priors_.empty() && priors_.back().stamp_ns >= stamp;
    if (!known && !waited(waiting.arrived, prior_timeout_)) return false;
  }
  if (!use_imu_ || inertial_.empty()) return true;
  // A recording may hand out a cloud before its last point was measured.
  const Time end(Duration(waiting.stamps.last_ns));
  const std::int64_t last = waiting.stamps.last_ns;
  if (last < inertial_.next_ns() || last - inertial_.newest_ns() > imu_silence_ns) return true;
  return waited(std::max(waiting.arrived, end), imu_timeout_);
}

void LidarOdometryComponent::process_waiting() {
  while (!waiting_.empty()) {
    Waiting& first = waiting_.front();
    if (!first.cloud) {
      const Result<lidar_odometry::Cloud> cloud = view(*first.message);
      if (!cloud) {
        health(Health::warn, std::to_string(++refused_) + " clouds refused: " + cloud.error().message);
        waiting_.pop_front();
        continue;
      }
      first.cloud = *cloud;
      first.stamps = engine_->stamps(*cloud);
    }
    if (!complete(first)) return;
    process(first);
    waiting_.pop_front();
  }
}

Result<lidar_odometry::Cloud> LidarOdometryComponent::view(const PointCloud2& message) {
  const Result<PointCloudView> points = PointCloudView::of(message);
  if (!points) return points.error();
  points_buffer_.resize(points->size());
  seconds_buffer_.resize(points->has_time() ? points->size() : 0);
  rings_buffer_.resize(points->has_ring() ? points->size() : 0);
  for (std::size_t i = 0; i < points->size(); ++i) {
    const std::array<float, 3> p = points->position(i);
    points_buffer_[i] = {p[0], p[1], p[2]};
  }
  for (std::size_t i = 0; i < seconds_buffer_.size(); ++i) seconds_buffer_[i] = static_cast<float>(points->time(i));
  for (std::size_t i = 0; i < rings_buffer_.size(); ++i) rings_buffer_[i] = points->ring(i);
  lidar_odometry::Cloud cloud;
  cloud.stamp_ns = to_time(message.header.stamp).time_since_epoch().count();
  cloud.points = std::span<const lidar_odometry::Point3f>(points_buffer_);
  cloud.seconds = std::span<const float>(seconds_buffer_);
  cloud.rings = std::span<const std::uint16_t>(rings_buffer_);
  cloud.width = points->width();
  cloud.height = points->height();
  return cloud;
}

std::optional<lidar_odometry::Prior> LidarOdometryComponent::prior_for(std::int64_t instant_ns,
                                                                       const std::optional<Pose>& guess) const {
  if (!use_prior_ || !last_ns_) return std::nullopt;
  if (prior_kind_ != PriorKind::guess) return motion_.between(*last_ns_, instant_ns);
  if (!guess || !prior_at_last_) return std::nullopt;
  lidar_odometry::Prior prior;
  prior.pose = prior_at_last_->inverse() * *guess;
  return prior;
}

void LidarOdometryComponent::process(const Waiting& waiting) {
  const std::int64_t instant = waiting.stamps.reference_ns;
  const std::optional<Pose> guess = interpolate(priors_, instant);
  std::optional<lidar_odometry::Prior> prior = prior_for(instant, guess);
  if (use_prior_ && !prior) ++without_prior_;
  if (use_imu_) {
    const std::optional<lidar_odometry::Prior> inertial = inertial_.predict(waiting.stamps);
    imu_missing_ = !inertial;
    if (imu_missing_) ++without_imu_;
    if (inertial) prior = prior ? combined(*inertial, *prior) : *inertial;
  }
  const lidar_odometry::Estimate& estimate = engine_->process(*waiting.cloud, prior ? &*prior : nullptr);
  if (use_imu_) inertial_.correct(estimate);
  if (estimate.status != lidar_odometry::Status::bad_stamp) {
    prior_at_last_ = guess;
    last_ns_ = instant;
  }
  report(estimate);
  if (estimate.status == lidar_odometry::Status::initialising || registered(estimate.status)) {
    const std::string& frame_id = waiting.message->header.frame_id;
    if (registered(estimate.status)) publish_localizability(estimate, frame_id);
    publish(estimate, frame_id);
  }
}

void LidarOdometryComponent::publish(const lidar_odometry::Estimate& estimate, const std::string& frame_id) {
  Loan<Odometry> message = odometry_.loan();
  message->header.stamp = to_stamp(Time(Duration(estimate.stamp_ns)));
  message->header.frame_id = odom_frame_.value();
  message->child_frame_id = frame_id;
  const Eigen::Quaterniond q(estimate.pose.linear());
  const Eigen::Vector3d t = estimate.pose.translation();
  message->pose.pose.position = {t.x(), t.y(), t.z()};
  message->pose.pose.orientation = {q.x(), q.y(), q.z(), q.w()};
  const Matrix6d covariance = lidar_odometry::covariance_in_parent_axes(estimate.pose, estimate.covariance);
  std::copy_n(covariance.data(), covariance.size(), message->pose.covariance.begin());  // symmetric: order is free
  const Vector6d& v = estimate.twist;
  message->twist.twist.linear = {v[0], v[1], v[2]};
  message->twist.twist.angular = {v[3], v[4], v[5]};
  message->twist.covariance.fill(0.0);
  odometry_.publish(std::move(message));
}

void fill(const std::array<Direction, 3>& directions, double unknown, std::array<double, 9>& axes,
          std::array<double, 3>& information, std::array<double, 3>& sigma, std::array<std::uint8_t, 3>& classes) {
  for (std::size_t i = 0; i < 3; ++i) {
    const Direction& d = directions[i];
    for (std::size_t k = 0; k < 3; ++k) axes[3 * i + k] = d.axis[static_cast<int>(k)];
    sigma[i] = std::min(d.sigma, unknown);
    information[i] = std::isinf(d.sigma) ? 0.0 : 1.0 / std::max(d.sigma * d.sigma, 1e-18);
    classes[i] = d.observable          ? LocalizabilityMessage::LOCALIZABLE
                 : std::isinf(d.sigma) ? LocalizabilityMessage::NONE
                                       : LocalizabilityMessage::PARTIAL;
  }
}

void LidarOdometryComponent::publish_localizability(const lidar_odometry::Estimate& estimate,
                                                    const std::string& frame_id) {
  if (!localizability_.has_readers()) return;
  Loan<LocalizabilityMessage> message = localizability_.loan();
  LocalizabilityMessage& m = *message;
  m.header.stamp = to_stamp(Time(Duration(estimate.stamp_ns)));
  m.header.frame_id = frame_id;
  const lidar_odometry::Localizability& l = estimate.localizability;
  fill(l.translation, 10.0, m.translation_directions, m.translation_information, m.translation_sigma,
       m.translation_class);
  fill(l.rotation, std::numbers::pi, m.rotation_directions, m.rotation_information, m.rotation_sigma, m.rotation_class);
  std::copy_n(estimate.information.data(), estimate.information.size(), m.information.begin());  // symmetric
  std::copy_n(estimate.gradient.data(), estimate.gradient.size(), m.gradient.begin());
  m.required_sigma = lidar_odometry::SurfelConfig{}.required_translation;
  m.residual_sigma = estimate.scan.rms_residual;
  m.correspondences = estimate.scan.matched;
  m.degenerate = estimate.status == lidar_odometry::Status::degenerate;
  localizability_.publish(std::move(message));
}

void LidarOdometryComponent::report(const lidar_odometry::Estimate& estimate) {
  const lidar_odometry::TotalCounters& total = estimate.total;
  const bool fine = !imu_missing_ && (estimate.status == lidar_odometry::Status::ok ||
                                      estimate.status == lidar_odometry::Status::initialising);
  std::string reason = std::string(to_string(estimate.status)) + ": " + std::to_string(total.registered) + " of " +
                       std::to_string(total.clouds) + " clouds registered";
  if (total.degenerate > 0) reason += ", " + std::to_string(total.degenerate) + " degenerate";
  if (total.refused + refused_ > 0) reason += ", " + std::to_string(total.refused + refused_) + " refused";
  if (total.lost > 0) reason += ", " + std::to_string(total.lost) + " lost";
  if (without_prior_ > 1) reason += ", " + std::to_string(without_prior_ - 1) + " without their prior";
  const lidar_odometry::InertialCounters& imu = inertial_.counters();
  if (without_imu_ > 0) reason += ", " + std::to_string(without_imu_) + " without IMU";
  if (imu.refused > 0) reason += ", " + std::to_string(imu.refused) + " IMU samples refused";
  if (imu.contradicted > 0) reason += ", " + std::to_string(imu.contradicted) + " against the IMU";
  health(fine ? Health::ok : Health::warn, std::move(reason));
}

ADIT_COMPONENT(LidarOdometryComponent, "lidar_odometry");

}  // namespace
}  // namespace adit
