#include "components/state_estimator/state_estimator.hpp"

#include <algorithm>
#include <cmath>

namespace adit::state_estimator {
namespace {

double square(double value) {
  return value * value;
}

FilterState initial_state(const InitialState& initial, const Config& config, std::int64_t stamp_ns) {
  FilterState s;
  s.stamp_ns = stamp_ns;
  s.x(kX) = initial.x;
  s.x(kY) = initial.y;
  s.x(kYaw) = wrap_angle(initial.yaw);
  s.x(kSpeed) = initial.speed;
  const auto sigma = [&](int index, double value) { s.p(index, index) = value * value; };
  sigma(kX, initial.sigma_position);
  sigma(kY, initial.sigma_position);
  sigma(kYaw, initial.sigma_yaw);
  sigma(kSpeed, initial.sigma_speed);
  sigma(kAccel, initial.sigma_accel);
  sigma(kYawRate, initial.sigma_yaw_rate);
  sigma(kYawAccel, initial.sigma_yaw_accel);
  // Calibration states live only where a sensor can show them.
  for (const OdometrySensor& o : config.odometries) {
    if (o.odometry.calibration.scale) sigma(kScale, initial.sigma_scale);
    if (o.odometry.calibration.yaw_bias) sigma(kThermalYawBias, initial.sigma_thermal_yaw_bias);
  }
  if (config.imu.enabled) sigma(kGyroBias, config.imu.yaw_rate_bias);
  if (config.imu.enabled && config.imu.use_acceleration) sigma(kAccelBias, config.imu.acceleration_bias);
  return s;
}

// The rotation without its heading: body axes to levelled axes.
Eigen::Matrix3d level_of(const Eigen::Matrix3d& rotation) {
  return so3_exp({0.0, 0.0, -yaw(rotation)}) * rotation;
}

}  // namespace

const char* to_string(Mode mode) {
  switch (mode) {
    case Mode::initializing:
      return "initializing";
    case Mode::fused:
      return "fused";
    case Mode::lidar:
      return "lidar";
    case Mode::thermal:
      return "thermal";
    case Mode::other:
      return "other";
    case Mode::dead_reckoning:
      return "dead_reckoning";
  }
  return "?";
}

Result<std::unique_ptr<StateEstimator>> StateEstimator::create(const Config& config) {
  if (Result<void> ok = check(config); !ok) return ok.error();
  return std::unique_ptr<StateEstimator>(new StateEstimator(config));
}

StateEstimator::StateEstimator(const Config& config)
    : config_(config),
      replay_(filter_, config.replay),
      map_(config.map_correction),
      tilt_(config.imu.tilt),
      standstill_(config.imu.standstill) {
  filter_.process = config.process;
  filter_.gate = config.gate;
  filter_.disagreement = config.disagreement;
  int slot = 0;
  for (const OdometrySensor& o : config.odometries) {
    SensorModel model;
    model.moves = true;
    model.scaled = o.odometry.calibration.scale;
    if (o.odometry.relative_pose) {
      model.clone_slot = slot;
      model.reanchor = o.odometry.anchor_period_s <= 0.0;
      model.model = std::make_unique<PlanarRelativePose>(slot++, o.odometry.calibration);
    } else {
      model.model = std::make_unique<SpeedAndYawRate>(o.odometry.calibration);
    }
    odometries_.push_back({o, std::nullopt, std::nullopt});
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
  replay_.restart(initial_state(config_.initial, config_, now_ns));
  started_ = true;
}

// Keeps the pose of an instant, forgets the motion, the clones and everything that carries a stamp.
void StateEstimator::restart_at(std::int64_t stamp_ns, std::int64_t pose_of_ns) {
  FilterState old = replay_.head();
  // No further ahead than a silence may be: beyond, the covariance only loses digits.
  const std::int64_t silence_ns = static_cast<std::int64_t>(config_.longest_silence_s * 1e9);
  predict(old, pose_of_ns - old.stamp_ns > silence_ns ? old.stamp_ns + silence_ns : pose_of_ns, filter_.process);
  FilterState fresh = initial_state(config_.initial, config_, stamp_ns);
  constexpr int kept[] = {kX, kY, kYaw, kScale, kThermalYawBias, kGyroBias, kAccelBias};
  for (const int i : kept) {
    fresh.x(i) = old.x(i);
    for (const int j : kept) fresh.p(i, j) = old.p(i, j);
  }
  for (std::size_t i = 0; i < old.sensors.size(); ++i) {
    SensorState& s = fresh.sensors[i];
    s = old.sensors[i];
    s.last_accepted_ns = s.last_received_ns = kNoStamp;
    s.window = MotionWindow{};
    s.is_distrusted = false;
    s.consecutive_rejections = 0;
  }
  replay_.restart(fresh);
  for (Odometry& o : odometries_) o.anchor = o.previous = std::nullopt;
  tilt_ = Tilt(config_.imu.tilt);
  standstill_ = StandstillDetector(config_.imu.standstill);
  published_ns_ = zero_velocity_ns_ = height_ns_ = closure_ns_ = kNoStamp;
  last_output_ = std::nullopt;
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
  if (!started_) start(earliest - 200'000'000);
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
  switch (to_measurement(motion, odometries_[static_cast<std::size_t>(sensor)].config.odometry,
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
  Odometry& odometry = odometries_[static_cast<std::size_t>(sensor)];
  const OdometryConfig& config = odometry.config.odometry;
  const auto begin_anew = [&](Verdict verdict) {
    odometry.anchor = odometry.previous = sample;
    return verdict == Verdict::first ? verdict : count(sensor, verdict);
  };
  if (!odometry.previous || odometry.previous->frame != sample.frame) return begin_anew(Verdict::first);
  const double step = seconds_between(odometry.previous->stamp_ns, sample.stamp_ns);
  if (step == 0.0) return count(sensor, Verdict::duplicate);
  if (step < 0.0 && step > -1.0) return count(sensor, Verdict::too_old);
  if (step < 0.0 || step > config.max_interval_s) return begin_anew(Verdict::gap);

  const auto motion_from = [&](const OdometrySample& from) {
    RelativeMotion motion;
    motion.from_ns = from.stamp_ns;
    motion.to_ns = sample.stamp_ns;
    motion.motion = from.pose.inverse() * sample.pose;
    motion.information = sample.information;
    motion.suspicion = sample.suspicion;
    if (odometry.config.level) {
      motion.level = level_of(from.pose.linear() * config.body_from_sensor.linear().transpose());
    } else if (tilt_.ready()) {
      motion.level = tilt_.level();
    }
    return motion;
  };
  Measurement m;
  switch (to_measurement(motion_from(*odometry.anchor), config, static_cast<std::uint8_t>(sensor), m)) {
    case Conversion::ok:
      break;
    case Conversion::not_finite:
      return count(sensor, Verdict::malformed);
    case Conversion::bad_interval:
      return begin_anew(Verdict::gap);
    case Conversion::implausible:
      return begin_anew(Verdict::jump);
  }
  if (odometry.anchor->stamp_ns != odometry.previous->stamp_ns) {
    Measurement last;  // the anchor may be seconds back: the motion of now is that of the last step
    const Conversion converted =
        to_measurement(motion_from(*odometry.previous), config, static_cast<std::uint8_t>(sensor), last);
    if (converted == Conversion::implausible) return begin_anew(Verdict::jump);
    m.motion = last.motion;
  }
  const Verdict verdict = insert(m, now_ns);
  if (verdict == Verdict::fused) carry_attitude(odometry, odometry.previous->pose, sample);
  odometry.previous = sample;
  const bool keep = config.anchor_period_s > 0.0 && verdict == Verdict::fused &&
                    seconds_between(odometry.anchor->stamp_ns, sample.stamp_ns) < config.anchor_period_s;
  if (!keep) odometry.anchor = sample;
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
  const Eigen::Matrix3d level = tilt_.level();
  Measurement m;
  m.sensor = static_cast<std::uint8_t>(imu_);
  m.stamp_ns = sample.stamp_ns;
  m.rows = config.use_acceleration ? 2 : 1;
  m.value << level.row(2).dot(gyro), level.row(0).dot(force), 0.0;
  m.covariance = Eigen::Vector3d(square(config.sigma_yaw_rate), square(config.sigma_acceleration), 1.0).asDiagonal();
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
void StateEstimator::carry_attitude(const Odometry& odometry, const Pose& from, const OdometrySample& to) {
  const int index = static_cast<int>(&odometry - odometries_.data());
  const bool leads = height_from_ < 0 || index <= height_from_ || height_ns_ == kNoStamp ||
                     seconds_between(height_ns_, to.stamp_ns) > 2.0 * config_.outage_s;
  if (!odometry.config.level || !leads || replay_.head().sensors[static_cast<std::size_t>(index)].is_distrusted) return;
  const Pose sensor_from_body = odometry.config.odometry.body_from_sensor.inverse();
  height_ += (to.pose * sensor_from_body).translation().z() - (from * sensor_from_body).translation().z();
  tilt_from_odometry_ = level_of((to.pose * sensor_from_body).linear());
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

Estimate StateEstimator::to_estimate(const FilterState& state) const {
  Estimate e;
  e.stamp_ns = state.stamp_ns;
  // An odometry's roll and pitch are smoother than the IMU's, which shakes with the body; without one, the IMU's.
  const bool from_odometry =
      height_ns_ != kNoStamp && seconds_between(height_ns_, state.stamp_ns) < 2.0 * config_.outage_s;
  const Eigen::Matrix3d level = tilt_.ready() && !from_odometry ? tilt_.level() : tilt_from_odometry_;
  e.pose.linear() = so3_exp({0.0, 0.0, state.x(kYaw)}) * level;
  e.pose.translation() = Eigen::Vector3d(state.x(kX), state.x(kY), height_);
  e.speed = state.x(kSpeed);
  e.accel = state.x(kAccel);
  e.yaw_rate = state.x(kYawRate);
  e.yaw_accel = state.x(kYawAccel);
  constexpr int pose[3] = {kX, kY, kYaw};
  constexpr int twist[2] = {kSpeed, kYawRate};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) e.pose_covariance(i, j) = state.p(pose[i], pose[j]);
  }
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) e.twist_covariance(i, j) = state.p(twist[i], twist[j]);
  }
  return e;
}

std::optional<Estimate> StateEstimator::estimate(std::int64_t stamp_ns) const {
  if (!started_) return std::nullopt;
  const std::optional<FilterState> state = replay_.state_at(stamp_ns);
  return state ? std::optional<Estimate>(to_estimate(*state)) : std::nullopt;
}

std::optional<Estimate> StateEstimator::publish(std::int64_t now_ns) {
  watch_clock(now_ns);
  if (published_ns_ != kNoStamp && now_ns <= published_ns_) return std::nullopt;
  std::optional<Estimate> e = estimate(now_ns);
  if (!e) return e;
  published_ns_ = now_ns;
  smooth(*e);
  return e;
}

// The part of a correction beyond the permitted jump is taken off the output and given back over smoothing_s.
void StateEstimator::smooth(Estimate& e) {
  const Estimate raw = e;
  if (config_.smoothing_s > 0.0 && last_output_) {
    const double dt = seconds_between(last_output_->stamp_ns, e.stamp_ns);
    const PlanarPose before(last_output_->pose.translation().x(), last_output_->pose.translation().y(),
                            yaw(last_output_->pose.linear()));
    const double turn = last_output_->yaw_rate * dt;
    const PlanarPose expected = compose(before, {last_output_->speed * dt * std::cos(0.5 * turn),
                                                 last_output_->speed * dt * std::sin(0.5 * turn), turn});
    const PlanarPose now(e.pose.translation().x(), e.pose.translation().y(), yaw(e.pose.linear()));
    PlanarPose jump = now - expected;
    jump.z() = wrap_angle(jump.z());
    not_yet_shown_ *= std::exp(-dt / config_.smoothing_s);
    // Seldom outputs (several hundred ms apart) move on by themselves: what they do in between is no jump.
    const double distance = jump.head<2>().norm();
    const bool often = dt < 0.3;
    if (often && distance > config_.largest_jump_m) {
      not_yet_shown_.head<2>() -= jump.head<2>() * (1.0 - config_.largest_jump_m / distance);
    }
    if (often && std::abs(jump.z()) > config_.largest_jump_rad) {
      not_yet_shown_.z() -= jump.z() * (1.0 - config_.largest_jump_rad / std::abs(jump.z()));
    }
    e.pose.translation().head<2>() += not_yet_shown_.head<2>();
    e.pose.linear() = so3_exp({0.0, 0.0, not_yet_shown_.z()}) * e.pose.linear();
  } else {
    not_yet_shown_.setZero();
  }
  last_output_ = raw;
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
    SensorReport& r = status.sensors.emplace_back();
    r.name = names_[static_cast<std::size_t>(i)];
    if (s.last_accepted_ns != kNoStamp) r.age_s = seconds_between(s.last_accepted_ns, now_ns);
    r.distrusted = s.is_distrusted;
    r.healthy = s.last_accepted_ns != kNoStamp && r.age_s <= config_.outage_s && !s.is_distrusted;
    r.nis = s.nis;
    r.nis_dof = s.nis_dof;
    r.mean_nis_per_dof = s.examined > 0 ? s.nis_per_dof_sum / static_cast<double>(s.examined) : 0.0;
    r.accepted = s.accepted;
    r.rejected = s.rejected;
    r.distrusted_count = s.distrusted;
    r.unanchored = s.unanchored;
    r.uninformative = s.uninformative;
    r.forced = s.forced;
    r.too_old = c.too_old;
    r.duplicates = c.duplicates;
    r.future = c.future;
    r.malformed = c.malformed;
    r.gaps = c.gaps;
    r.jumps = c.jumps;
    if (!r.healthy || i >= static_cast<int>(odometries_.size())) continue;
    ++healthy;
    const Role role = odometries_[static_cast<std::size_t>(i)].config.role;
    single = role == Role::lidar ? Mode::lidar : role == Role::thermal ? Mode::thermal : Mode::other;
  }
  status.mode = !started_ ? Mode::initializing : healthy >= 2 ? Mode::fused : single;
  return status;
}

}  // namespace adit::state_estimator
