#include "components/state_estimator/state_estimator.hpp"

#include <algorithm>
#include <cmath>

#include "components/state_estimator/initial_state.hpp"

namespace adit::state_estimator {

Result<std::unique_ptr<StateEstimator>> StateEstimator::create(const Config& config) {
  if (Result<void> ok = check(config); !ok) return ok.error();
  return std::unique_ptr<StateEstimator>(new StateEstimator(config));
}

StateEstimator::StateEstimator(const Config& config)
    : config_(config),
      replay_(filter_, config.replay),
      map_(config.map_correction),
      tilt_(config.imu.tilt),
      standstill_(config.imu.standstill),
      smoother_({config.largest_jump_m, config.largest_jump_rad, config.smoothing_s}) {
  filter_.process = config.process;
  filter_.gate = config.gate;
  filter_.disagreement = config.disagreement;
  filter_.adaptation = config.adaptation;
  filter_.scale_sigma = config.initial.sigma_scale;
  int slot = 0;
  for (const OdometrySensor& o : config.odometries) {
    SensorModel model;
    model.moves = true;
    model.scaled = o.odometry.calibration.scale;
    model.adapts = !o.odometry.fixed_noise;
    if (o.odometry.relative_pose) {
      model.clone_slot = slot;
      model.reanchor = o.odometry.anchor_period_s <= 0.0;
      model.model = std::make_unique<PlanarRelativePose>(slot++, o.odometry.calibration);
    } else {
      model.model = std::make_unique<SpeedAndYawRate>(o.odometry.calibration);
    }
    odometries_.emplace_back(o, static_cast<std::uint8_t>(odometries_.size()));
    add_sensor(o.name, std::move(model));
  }
  if (config.imu.enabled) {
    SensorModel model;
    model.moves = config.imu.use_acceleration;
    if (config.imu.use_acceleration) {
      model.model = std::make_unique<ImuYawRateAndAcceleration>(config.imu.body_from_sensor.translation().head<2>());
    } else {
      model.model = std::make_unique<GyroYawRate>();
    }
    imu_ = add_sensor("imu", std::move(model));
  }
  if (config.gnss.enabled) {
    SensorModel model;
    model.model = std::make_unique<GnssPosition>(config.gnss.lever_arm);
    gnss_ = add_sensor("gnss", std::move(model));
  }
  if (config.zero_velocity.enabled) {
    SensorModel model;
    model.model = std::make_unique<ZeroVelocity>();
    model.standstill = true;
    zero_velocity_ = add_sensor("zero_velocity", std::move(model));
  }
}

int StateEstimator::add_sensor(const std::string& name, SensorModel model) {
  const int index = filter_.add_sensor(std::move(model));
  if (index >= 0) names_.push_back(name);
  return index;
}

int StateEstimator::sensor(const std::string& name) const {
  const auto found = std::find(names_.begin(), names_.end(), name);
  return found == names_.end() ? -1 : static_cast<int>(found - names_.begin());
}

void StateEstimator::start(std::int64_t now_ns) {
  replay_.restart(initial_state(config_, now_ns));
  started_ = true;
}

// Keeps the pose of an instant, forgets the motion, the clones and everything that carries a stamp.
void StateEstimator::restart_at(std::int64_t stamp_ns, std::int64_t pose_of_ns) {
  FilterState old = replay_.head();
  // No further ahead than a silence may be: beyond, the covariance only loses digits.
  const std::int64_t silence_ns = static_cast<std::int64_t>(config_.longest_silence_s * 1e9);
  predict(old, pose_of_ns - old.stamp_ns > silence_ns ? old.stamp_ns + silence_ns : pose_of_ns, filter_.process);
  replay_.restart(without_motion(old, config_, stamp_ns));
  for (OdometryTrack& track : odometries_) track.restart();
  tilt_ = Tilt(config_.imu.tilt);
  standstill_ = StandstillDetector(config_.imu.standstill);
  published_ns_ = zero_velocity_ns_ = height_ns_ = closure_ns_ = kNoStamp;
  smoother_.restart();
}

bool StateEstimator::watch_clock(std::int64_t now_ns) {
  const bool back = started_ && now_ns_ != kNoStamp && seconds_between(now_ns, now_ns_) > config_.clock_jump_s;
  if (back) {
    ++clock_jumps_;
    restart_at(now_ns, now_ns_);
  }
  now_ns_ = now_ns_ == kNoStamp || back ? now_ns : std::max(now_ns_, now_ns);
  return back;
}

Verdict StateEstimator::count(int sensor, Verdict verdict) {
  Counters& c = counters_[static_cast<std::size_t>(sensor)];
  switch (verdict) {
    case Verdict::too_old:
      ++c.too_old;
      break;
    case Verdict::duplicate:
      ++c.duplicates;
      break;
    case Verdict::from_the_future:
      ++c.future;
      break;
    case Verdict::malformed:
      ++c.malformed;
      break;
    case Verdict::gap:
      ++c.gaps;
      break;
    case Verdict::jump:
      ++c.jumps;
      break;
    default:
      break;
  }
  return verdict;
}

Verdict StateEstimator::insert(const Measurement& m, std::int64_t now_ns) {
  if (seconds_between(now_ns, m.stamp_ns) > config_.future_tolerance_s) return Verdict::from_the_future;
  const SensorModel& model = filter_.sensor(m.sensor);
  const bool relative = model.clone_slot >= 0;
  const std::int64_t earliest = relative ? m.anchor_ns : m.stamp_ns;
  // Whatever time it waited: where the body is when its motion is measured for the first time is where odom begins.
  if (!measured_) start(earliest);
  measured_ = true;
  if (seconds_between(replay_.head().stamp_ns, earliest) > config_.longest_silence_s) {
    restart_at(earliest, earliest);
    ++forgotten_motions_;
  }
  if (relative && !replay_.has_anchor(m.sensor, m.anchor_ns)) {
    Measurement clone;
    clone.kind = Measurement::Kind::clone;
    clone.sensor = m.sensor;
    clone.stamp_ns = m.anchor_ns;
    if (replay_.insert(clone) == ReplayBuffer::Outcome::too_old) return Verdict::too_old;
  }
  switch (replay_.insert(m)) {
    case ReplayBuffer::Outcome::too_old:
      return Verdict::too_old;
    case ReplayBuffer::Outcome::duplicate:
      return Verdict::duplicate;
    case ReplayBuffer::Outcome::replayed:
      ++replays_;
      return Verdict::fused;
    case ReplayBuffer::Outcome::applied:
      return Verdict::fused;
  }
  return Verdict::fused;
}

Verdict StateEstimator::add_measurement(const Measurement& m, std::int64_t now_ns) {
  if (m.sensor >= filter_.sensor_count()) return Verdict::unknown_sensor;
  watch_clock(now_ns);
  const bool finite = m.value.allFinite() && m.projection.allFinite() && m.covariance.allFinite() &&
                      m.covariance.diagonal().minCoeff() >= 0.0 && m.rows <= kMaxRows;
  if (!finite || m.kind != Measurement::Kind::update) return count(m.sensor, Verdict::malformed);
  const Verdict verdict = insert(m, now_ns);
  if (verdict == Verdict::fused && filter_.sensor(m.sensor).moves) maybe_stand_still(m.stamp_ns, now_ns);
  return count(m.sensor, verdict);
}

Verdict StateEstimator::add_motion(int sensor, const RelativeMotion& motion, std::int64_t now_ns) {
  if (sensor < 0 || sensor >= static_cast<int>(odometries_.size())) return Verdict::unknown_sensor;
  Measurement m;
  switch (to_measurement(motion, odometries_[static_cast<std::size_t>(sensor)].config().odometry,
                         static_cast<std::uint8_t>(sensor), m)) {
    case Conversion::ok:
      return add_measurement(m, now_ns);
    case Conversion::not_finite:
      return count(sensor, Verdict::malformed);
    case Conversion::bad_interval:
      return count(sensor, Verdict::gap);
    case Conversion::implausible:
      return count(sensor, Verdict::jump);
  }
  return count(sensor, Verdict::malformed);
}

Verdict StateEstimator::add_odometry(int sensor, const OdometrySample& sample, std::int64_t now_ns) {
  if (sensor < 0 || sensor >= static_cast<int>(odometries_.size())) return Verdict::unknown_sensor;
  watch_clock(now_ns);
  if (!sample.pose.matrix().allFinite()) return count(sensor, Verdict::malformed);
  if (seconds_between(now_ns, sample.stamp_ns) > config_.future_tolerance_s) {
    return count(sensor, Verdict::from_the_future);
  }
  OdometryTrack& track = odometries_[static_cast<std::size_t>(sensor)];
  Measurement m;
  Verdict verdict =
      track.follow(sample, tilt_.ready() ? std::optional<Eigen::Matrix3d>(tilt_.level()) : std::nullopt, m);
  if (verdict != Verdict::fused) return count(sensor, verdict);
  verdict = insert(m, now_ns);
  if (verdict == Verdict::fused) carry_attitude(track, track.previous_pose(), sample);
  const FilterState& head = replay_.head();
  const SensorState& statistics = head.sensors[static_cast<std::size_t>(sensor)];
  const bool whole = m.rows == kMaxRows && !head.conflict;  // every direction known, nobody contradicts
  track.accept(sample, verdict, whole && !statistics.is_distrusted && statistics.consecutive_rejections == 0);
  if (verdict == Verdict::fused) maybe_stand_still(m.stamp_ns, now_ns);
  return count(sensor, verdict);
}

Verdict StateEstimator::add_imu(const ImuSample& sample, std::int64_t now_ns) {
  if (imu_ < 0) return Verdict::unknown_sensor;
  watch_clock(now_ns);
  const ImuSensor& config = config_.imu;
  const bool sane = sample.angular_rate.allFinite() && sample.specific_force.allFinite() &&
                    sample.angular_rate.norm() <= config.max_yaw_rate &&
                    sample.specific_force.norm() <= config.max_acceleration;
  if (!sane) return count(imu_, Verdict::malformed);
  const Eigen::Vector3d gyro = config.body_from_sensor.linear() * sample.angular_rate;
  const Eigen::Vector3d force = config.body_from_sensor.linear() * sample.specific_force;
  const StateVector& x = replay_.head().x;
  tilt_.update(sample.stamp_ns, gyro, force, x(kAccel), x(kSpeed) * x(kYawRate));
  standstill_.update(sample.stamp_ns, gyro, force);
  if (!tilt_.ready()) return Verdict::first;
  if (!odom_tilt_.ready()) odom_tilt_.observe(x(kYaw), tilt_from_odometry_, tilt_.level());
  const Eigen::Matrix3d level = tilt_.level();
  Measurement m;
  m.sensor = static_cast<std::uint8_t>(imu_);
  m.stamp_ns = sample.stamp_ns;
  m.rows = config.use_acceleration ? 2 : 1;
  m.value << level.row(2).dot(gyro), level.row(0).dot(force), 0.0;
  const double acceleration = square(config.sigma_acceleration) + standstill_.force_variance();
  m.covariance = Eigen::Vector3d(square(config.sigma_yaw_rate), acceleration, 1.0).asDiagonal();
  const Verdict verdict = insert(m, now_ns);
  if (verdict == Verdict::fused) maybe_stand_still(sample.stamp_ns, now_ns);
  return count(imu_, verdict);
}

Verdict StateEstimator::add_gnss(const GnssSample& sample, std::int64_t now_ns) {
  if (gnss_ < 0) return Verdict::unknown_sensor;
  watch_clock(now_ns);
  const Eigen::Matrix2d covariance = 0.5 * (sample.covariance + sample.covariance.transpose());
  const bool sane = sample.position.allFinite() && covariance.allFinite() && covariance.diagonal().minCoeff() > 0.0 &&
                    covariance.determinant() >= 0.0;
  if (!sane) return count(gnss_, Verdict::malformed);
  Measurement m;
  m.sensor = static_cast<std::uint8_t>(gnss_);
  m.stamp_ns = sample.stamp_ns;
  m.rows = covariance.diagonal().maxCoeff() <= square(config_.gnss.max_sigma) ? 2 : 0;
  m.value.head<2>() = sample.position;
  m.covariance.topLeftCorner<2, 2>() = covariance;
  m.covariance.diagonal().head<2>().array() += square(config_.gnss.floor);
  return count(gnss_, insert(m, now_ns));
}

// A still IMU and odometries that see no motion, or, without an IMU, two odometries that see none for a while.
void StateEstimator::maybe_stand_still(std::int64_t stamp_ns, std::int64_t now_ns) {
  const ZeroVelocityConfig& config = config_.zero_velocity;
  if (zero_velocity_ < 0) return;
  if (zero_velocity_ns_ != kNoStamp && seconds_between(zero_velocity_ns_, stamp_ns) < config.period_s) return;
  const FilterState& head = replay_.head();
  if (std::abs(head.x(kSpeed)) > 0.3 || std::abs(head.x(kYawRate)) > 0.1) return;
  int resting = 0;
  for (std::size_t i = 0; i < odometries_.size(); ++i) {
    const SensorState& s = head.sensors[i];
    const MotionWindow& w = s.window;
    const bool fresh = w.stamp_ns != kNoStamp && seconds_between(w.stamp_ns, stamp_ns) < config_.outage_s;
    if (!fresh || s.is_distrusted) continue;
    if (std::abs(w.speed) > config.odometry_speed || std::abs(w.yaw_rate) > config.odometry_yaw_rate) return;
    if (w.zero_since_ns != kNoStamp && seconds_between(w.zero_since_ns, stamp_ns) > 0.5) ++resting;
  }
  const bool imu_stands = imu_ >= 0 && standstill_.stands() && (resting > 0 || std::abs(head.x(kSpeed)) < 0.15);
  if (!imu_stands && (imu_ >= 0 || resting < 2)) return;
  Measurement m;
  m.sensor = static_cast<std::uint8_t>(zero_velocity_);
  m.stamp_ns = stamp_ns;
  m.rows = 2;
  m.covariance = Eigen::Vector3d(square(config.sigma_speed), square(config.sigma_yaw_rate), 1.0).asDiagonal();
  zero_velocity_ns_ = stamp_ns;
  count(zero_velocity_, insert(m, now_ns));
}

// Height, roll and pitch are not filtered: the leading odometry's are carried along.
void StateEstimator::carry_attitude(const OdometryTrack& track, const Pose& from, const OdometrySample& to) {
  const int index = static_cast<int>(&track - odometries_.data());
  const bool leads = height_from_ < 0 || index <= height_from_ || height_ns_ == kNoStamp ||
                     seconds_between(height_ns_, to.stamp_ns) > 2.0 * config_.outage_s;
  if (!track.config().level || !leads || replay_.head().sensors[static_cast<std::size_t>(index)].is_distrusted) return;
  const Pose sensor_from_body = track.config().odometry.body_from_sensor.inverse();
  height_ += (to.pose * sensor_from_body).translation().z() - (from * sensor_from_body).translation().z();
  tilt_from_odometry_ = level_of((to.pose * sensor_from_body).linear());
  if (tilt_.ready()) odom_tilt_.observe(replay_.head().x(kYaw), tilt_from_odometry_, tilt_.level());
  height_from_ = index;
  height_ns_ = to.stamp_ns;
}

MapCorrection::Outcome StateEstimator::add_closure(std::int64_t stamp_ns, const PlanarPose& map_body,
                                                   const Eigen::Matrix3d& covariance) {
  const std::optional<FilterState> at = replay_.state_at(stamp_ns);
  if (!at) return MapCorrection::Outcome::malformed;
  const PlanarPose odom_body(at->x(kX), at->x(kY), at->x(kYaw));
  // Drift since the previous closure: the growth of the pose covariance, in full when that is forgotten.
  constexpr int pose[3] = {kX, kY, kYaw};
  Eigen::Matrix3d drift;
  const std::optional<FilterState> before =
      closure_ns_ == kNoStamp ? std::nullopt : replay_.state_at(std::min(closure_ns_, stamp_ns));
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) drift(i, j) = at->p(pose[i], pose[j]) - (before ? before->p(pose[i], pose[j]) : 0.0);
  }
  for (int i = 0; i < 3; ++i) drift(i, i) = std::max(drift(i, i), 1e-8);
  const double largest = drift.diagonal().maxCoeff();
  if (before) drift = Eigen::Vector3d(drift.diagonal()).asDiagonal();  // a difference need not be a covariance
  if (!std::isfinite(largest)) return MapCorrection::Outcome::malformed;
  const MapCorrection::Outcome outcome = map_.add(map_body, covariance, odom_body, drift);
  if (outcome == MapCorrection::Outcome::applied) closure_ns_ = stamp_ns;
  return outcome;
}

Estimate StateEstimator::estimate_of(const FilterState& state) const {
  // An odometry's roll and pitch are smoother than the IMU's, which shakes with the body; without one, the IMU's.
  const bool from_odometry =
      height_ns_ != kNoStamp && seconds_between(height_ns_, state.stamp_ns) < 2.0 * config_.outage_s;
  const bool from_imu = tilt_.ready() && !from_odometry;
  return to_estimate(state, height_, from_imu ? odom_tilt_.in_odom(state.x(kYaw), tilt_.level()) : tilt_from_odometry_);
}

std::optional<Estimate> StateEstimator::estimate(std::int64_t stamp_ns) const {
  if (!started_) return std::nullopt;
  const std::optional<FilterState> state = replay_.state_at(stamp_ns);
  return state ? std::optional<Estimate>(estimate_of(*state)) : std::nullopt;
}

std::optional<Estimate> StateEstimator::publish(std::int64_t now_ns) {
  watch_clock(now_ns);
  if (published_ns_ != kNoStamp && now_ns <= published_ns_) return std::nullopt;
  std::optional<Estimate> e = estimate(now_ns);
  if (!e) return e;
  published_ns_ = now_ns;
  smoother_.apply(*e);
  return e;
}

std::optional<RelativePrediction> StateEstimator::predict_motion(std::int64_t from_ns, std::int64_t to_ns) const {
  if (!started_ || to_ns < from_ns) return std::nullopt;
  std::optional<FilterState> s = replay_.state_at(from_ns);
  if (!s) return std::nullopt;
  s->clone(kScratchSlot);
  for (const Measurement& m : replay_.events(from_ns, to_ns)) filter_.apply(*s, m);
  predict(*s, to_ns, filter_.process);
  const PlanarRelativePose model(kScratchSlot);
  Measurement zero;
  zero.stamp_ns = to_ns;
  zero.anchor_ns = from_ns;
  const Linearization l = model.linearize(*s, zero);
  RelativePrediction prediction;
  prediction.motion = -l.innovation;
  prediction.motion.z() = wrap_angle(prediction.motion.z());
  prediction.covariance = l.jacobian * s->p * l.jacobian.transpose();
  prediction.thermal_scale = std::exp(s->x(kScale));
  return prediction;
}

Status StateEstimator::status(std::int64_t now_ns) const {
  Status status;
  const FilterState& head = replay_.head();
  status.conflict = head.conflict;
  status.thermal_scale = std::exp(head.x(kScale));
  status.thermal_scale_sigma = status.thermal_scale * std::sqrt(std::max(0.0, head.p(kScale, kScale)));
  status.thermal_delay = head.x(kThermalDelay);
  status.thermal_delay_sigma = std::sqrt(std::max(0.0, head.p(kThermalDelay, kThermalDelay)));
  status.clock_jumps = clock_jumps_;
  status.forgotten_motions = forgotten_motions_;
  status.replays = replays_;
  status.closures = map_.applied();
  status.closures_rejected = map_.rejected();
  int healthy = 0;
  Mode single = Mode::dead_reckoning;
  for (int i = 0; i < filter_.sensor_count(); ++i) {
    const SensorState& s = head.sensors[static_cast<std::size_t>(i)];
    const Counters& c = counters_[static_cast<std::size_t>(i)];
    SensorReport& r =
        status.sensors.emplace_back(report_of(names_[static_cast<std::size_t>(i)], s, now_ns, config_.outage_s));
    r.too_old = c.too_old;
    r.duplicates = c.duplicates;
    r.future = c.future;
    r.malformed = c.malformed;
    r.gaps = c.gaps;
    r.jumps = c.jumps;
    if (!r.healthy || i >= static_cast<int>(odometries_.size())) continue;
    ++healthy;
    const Role role = odometries_[static_cast<std::size_t>(i)].config().role;
    single = role == Role::lidar ? Mode::lidar : role == Role::thermal ? Mode::thermal : Mode::other;
  }
  status.mode = !started_ ? Mode::initializing : healthy >= 2 ? Mode::fused : single;
  return status;
}

}  // namespace adit::state_estimator
