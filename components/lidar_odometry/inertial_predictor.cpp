#include "components/lidar_odometry/inertial_predictor.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "components/geometry/rigid.hpp"

namespace adit::lidar_odometry {
namespace {

constexpr double ns = 1e-9;
constexpr std::int64_t step_ns = 2'500'000;             // of the integration: half a sample at 200 Hz
constexpr double max_rate = 100.0, max_force = 1000.0;  // rad/s, m/s^2: beyond any IMU on a vehicle
constexpr int samples_to_believe = 10;                  // of a new time base
constexpr std::int64_t rest_ns = 1'000'000'000;         // of samples that tell the gravity at the start
constexpr double unknown_velocity = 10.0;               // m/s, sigma at the start
constexpr double coarse_velocity = 0.5;                 // m/s, sigma of one that is known from poses only
constexpr double contradiction = 100.0;                 // squared Mahalanobis distance of six dimensions: ten sigma
constexpr int contradictions_to_believe = 5;
constexpr std::int64_t silence_ns = 5'000'000'000;
constexpr int lasting_surprises = 20;  // sweeps that the mean square of what was not expected is of

constexpr double most_position = 0.05, most_rotation = 0.01;  // m, rad: of the pose against the local map
constexpr double known_position = 0.3;                        // m, sigma of a motion that is more than a guess

// Places of the errors in the covariance.
constexpr int position = 0, rotation = 3, velocity = 6, gravity = 9, bias = 12;

// The scaling of three turned errors that leaves none of them a greater deviation than `most`.
template <class Covariance>
Eigen::Matrix3d bounding(const Covariance& covariance, int first, const Eigen::Matrix3d& turn, double most) {
  const Eigen::Matrix3d own = turn * covariance.template block<3, 3>(first, first) * turn.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(own);
  const Eigen::Vector3d scale = (most / eigen.eigenvalues().cwiseMax(most * most).cwiseSqrt().array()).matrix();
  return eigen.eigenvectors() * scale.asDiagonal() * eigen.eigenvectors().transpose();
}

double seconds(std::int64_t from_ns, std::int64_t to_ns) {
  return ns * static_cast<double>(to_ns - from_ns);
}

}  // namespace

InertialPredictor::InertialPredictor(const InertialConfig& config) : config_(config) {
  poses_.reserve(1024);
}

void InertialPredictor::clear() {
  samples_.clear();
  refused_in_a_row_ = contradictions_in_a_row_ = surprises_ = 0;
  state_.reset();
  predicted_.reset();
  last_ns_ = silent_until_ns_ = 0;
  last_pose_ = Pose::Identity();
  last_twist_.reset();
}

bool InertialPredictor::add(const InertialSample& sample) {
  ++counters_.samples;
  const bool sane = sample.rate.allFinite() && sample.acceleration.allFinite() && sample.rate.norm() < max_rate &&
                    sample.acceleration.norm() < max_force;
  if (!sane) {
    ++counters_.refused;
    return false;
  }
  if (!samples_.empty() && sample.stamp_ns <= newest_ns()) {
    ++counters_.refused;
    refused_in_a_row_ = refused_in_a_row_ > 0 && sample.stamp_ns > refused_stamp_ ? refused_in_a_row_ + 1 : 1;
    refused_stamp_ = sample.stamp_ns;
    if (refused_in_a_row_ < samples_to_believe) return false;
    samples_.clear();
  }
  refused_in_a_row_ = 0;
  samples_.push(sample);
  return true;
}

bool InertialPredictor::covers(std::int64_t from_ns, std::int64_t to_ns) const {
  return usable_ >= 2 && samples_.covers(from_ns, to_ns, usable_, config_.max_extrapolation_s, config_.max_gap_s);
}

// Between two samples the cubic through the four around (a gait's rates bend within a sample), or the line at the ends
// and beside a lost sample; the line for up to one period beyond the last; then, and before the first, the nearest.
// Precondition: usable_ >= 2.
InertialSample InertialPredictor::reading(std::int64_t stamp_ns) const {
  std::size_t low = 0;
  std::size_t high = usable_ - 1;
  if (stamp_ns <= samples_[low].stamp_ns) return samples_[low];
  while (high - low > 1) {
    const std::size_t middle = (low + high) / 2;
    (samples_[middle].stamp_ns <= stamp_ns ? low : high) = middle;
  }
  const double period = seconds(samples_[low].stamp_ns, samples_[high].stamp_ns);
  const double t = seconds(samples_[low].stamp_ns, stamp_ns) / period;
  if (t > 2.0) return samples_[high];
  std::array<double, 4> weight{0.0, 1.0 - t, t, 0.0};
  const auto beside = [&](std::size_t i) {
    return std::abs(seconds(samples_[i].stamp_ns, samples_[i + 1].stamp_ns) - period) < 0.2 * period;
  };
  const bool four = low > 0 && high + 1 < usable_ && beside(low - 1) && beside(high);
  if (four) {  // Lagrange's, of equal steps
    weight = {-t * (t - 1.0) * (t - 2.0) / 6.0, (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
              -(t + 1.0) * t * (t - 2.0) / 2.0, (t + 1.0) * t * (t - 1.0) / 6.0};
  }
  InertialSample result;
  result.stamp_ns = stamp_ns;
  for (std::size_t k = four ? 0 : 1; k < (four ? 4u : 3u); ++k) {
    const InertialSample& sample = samples_[low + k - 1];
    result.rate += weight[k] * sample.rate;
    result.acceleration += weight[k] * sample.acceleration;
  }
  return result;
}

// The midpoint rule, forwards or backwards in time.
void InertialPredictor::advance(State& state, std::int64_t from_ns, std::int64_t to_ns, bool with_covariance) const {
  const std::int64_t whole = to_ns - from_ns;
  const std::int64_t steps = std::max<std::int64_t>(1, (std::abs(whole) + step_ns - 1) / step_ns);
  const double dt = ns * static_cast<double>(whole) / static_cast<double>(steps);
  for (std::int64_t k = 0; k < steps; ++k) {
    const InertialSample middle = reading(from_ns + whole * (2 * k + 1) / (2 * steps));
    const Eigen::Vector3d turn = dt * (middle.rate - state.gyro_bias);
    const Eigen::Matrix3d half = state.rotation * so3_exp(0.5 * turn);
    const Eigen::Vector3d acceleration = half * middle.acceleration + state.gravity;
    if (with_covariance) {
      using Block = Eigen::Matrix3d;
      Covariance f = Covariance::Identity();
      const Block pull = -dt * half * skew(middle.acceleration);
      f.block<3, 3>(position, velocity) = dt * Block::Identity();
      f.block<3, 3>(position, rotation) = 0.5 * dt * pull;
      f.block<3, 3>(position, gravity) = 0.5 * dt * dt * Block::Identity();
      f.block<3, 3>(rotation, rotation) = so3_exp(turn).transpose();
      f.block<3, 3>(rotation, bias) = -dt * Block::Identity();
      f.block<3, 3>(velocity, rotation) = pull;
      f.block<3, 3>(velocity, gravity) = dt * Block::Identity();
      const Covariance carried = f * state.covariance * f.transpose();
      state.covariance = carried;
      const auto grow = [&](int first, double density) {
        state.covariance.diagonal().segment<3>(first).array() += density * density * std::abs(dt);
      };
      grow(rotation, config_.gyro_noise);
      grow(velocity, config_.accel_noise);
      grow(gravity, config_.accel_walk);
      grow(bias, config_.gyro_walk);
    }
    state.position += dt * state.velocity + 0.5 * dt * dt * acceleration;
    state.velocity += dt * acceleration;
    state.rotation = state.rotation * so3_exp(turn);
  }
  state.rotation = orthonormalized(state.rotation);
}

// As if at rest: the mean of the accelerometer before that instant, turned along, is the gravity. Its spread tells how
// wrong that is.
InertialPredictor::State InertialPredictor::at_rest(std::int64_t stamp_ns) const {
  State state;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  int count = 0;
  Eigen::Matrix3d turned = Eigen::Matrix3d::Identity();  // of the sample in the frame at that instant
  std::int64_t now = stamp_ns;
  while (now - step_ns >= std::max(stamp_ns - rest_ns, samples_[0].stamp_ns) && covers(now - step_ns, stamp_ns)) {
    const InertialSample middle = reading(now - step_ns / 2);
    turned = turned * so3_exp(-ns * static_cast<double>(step_ns) * middle.rate);
    const Eigen::Vector3d force = turned * middle.acceleration;
    mean += force;
    squares += force.cwiseAbs2();
    ++count;
    now -= step_ns;
  }
  const double n = std::max(count, 1);
  mean = count > 0 ? Eigen::Vector3d(mean / n) : reading(stamp_ns).acceleration;
  const double spread = std::sqrt(std::max(0.0, (squares / n - mean.cwiseAbs2()).sum()));
  state.gravity = -mean;
  state.covariance.diagonal().segment<3>(velocity).setConstant(unknown_velocity * unknown_velocity);
  state.covariance.diagonal().segment<3>(gravity).setConstant(std::pow(0.1 + 0.5 * spread, 2));
  state.covariance.diagonal().segment<3>(bias).setConstant(config_.gyro_bias * config_.gyro_bias);
  return state;
}

// That of poses, without samples between them.
void InertialPredictor::set_velocity(State& state, const Vector6d& lidar_twist) const {
  const Pose& mounting = config_.lidar_from_imu;
  const Vector6d twist = se3_adjoint(mounting.inverse()) * lidar_twist;
  state.velocity = twist.head<3>();
  state.covariance.middleRows<3>(velocity).setZero();
  state.covariance.middleCols<3>(velocity).setZero();
  // The sweeps that it is from were undistorted with another one.
  const double sigma = std::clamp(0.5 * state.velocity.norm(), coarse_velocity, 0.5 * unknown_velocity);
  state.covariance.diagonal().segment<3>(velocity).setConstant(sigma * sigma);
}

// Moves the frame of the state to its own pose. What the pose is wrong by against the map stays with it, so that the
// next match may correct it; along what no match corrects it stays bounded, since the map grows where the pose is.
void InertialPredictor::rebase(State& state) const {
  const Eigen::Matrix3d back = state.rotation.transpose();
  state.velocity = back * state.velocity;
  state.gravity = back * state.gravity;
  Covariance turn = Covariance::Identity();
  for (const int block : {position, velocity, gravity}) turn.block<3, 3>(block, block) = back;
  turn.middleRows<3>(position) =
      bounding(state.covariance, position, back, most_position) * turn.middleRows<3>(position);
  turn.middleRows<3>(rotation) =
      bounding(state.covariance, rotation, Eigen::Matrix3d::Identity(), most_rotation) * turn.middleRows<3>(rotation);
  const Covariance turned = turn * state.covariance * turn.transpose();
  state.covariance = 0.5 * (turned + turned.transpose());
  state.position.setZero();
  state.rotation.setIdentity();
}

void InertialPredictor::sample_sweep(const SweepStamps& sweep) {
  poses_.clear();
  State state = *state_;
  std::int64_t now = std::min(sweep.first_ns, last_ns_);
  if (now < last_ns_) advance(state, last_ns_, now, false);
  if (now < sweep.first_ns) {
    advance(state, last_ns_, sweep.first_ns, false);
    now = sweep.first_ns;
  }
  const Pose imu_from_lidar = config_.lidar_from_imu.inverse();
  const auto note = [&] {
    Pose imu = Pose::Identity();
    imu.linear() = state.rotation;
    imu.translation() = state.position;
    poses_.push_back({now, imu * imu_from_lidar});
  };
  note();
  while (now < sweep.last_ns && poses_.size() < poses_.capacity()) {
    const std::int64_t next = std::min(now + step_ns, sweep.last_ns);
    advance(state, now, next, false);
    now = next;
    note();
  }
}

// What the poses within a sweep are wrong by, as a constant twist of the LiDAR: by what the last poses found differed
// from those expected, or, before there were any, by what the filter knows of itself. The rotation also by the noise of
// the gyroscope and by what its samples leave open between them. Both show in their fourth differences, which a motion
// does not have that the samples resolve: of white noise they are sqrt(70) times its deviation. Its integral over a
// sweep is a random walk, its end is off the mean of the way by a third of its variance; a constant rate that does the
// same to the end has half a sweep to do it. Precondition: predicted_.
Matrix6d InertialPredictor::sweep_covariance(const SweepStamps& sweep) const {
  Matrix6d twist = Matrix6d::Zero();
  const double duration = seconds(sweep.first_ns, sweep.last_ns);
  if (!(duration > 0.0)) return twist;
  Eigen::Vector3d angle = Eigen::Vector3d::Zero();  // variance at the end
  for (std::size_t last = usable_ - 1; last >= 4 && samples_[last].stamp_ns >= sweep.first_ns; --last) {
    const double dt = seconds(samples_[last - 1].stamp_ns, samples_[last].stamp_ns);
    const Eigen::Vector3d difference = samples_[last].rate - 4.0 * samples_[last - 1].rate +
                                       6.0 * samples_[last - 2].rate - 4.0 * samples_[last - 3].rate +
                                       samples_[last - 4].rate;
    angle += dt * dt / 70.0 * difference.cwiseAbs2();
  }
  if (surprises_ > 0) {
    twist.diagonal() = surprise2_;
  } else {
    const Covariance& p = predicted_->covariance;
    twist.topLeftCorner<3, 3>() = p.block<3, 3>(velocity, velocity);
    twist.bottomRightCorner<3, 3>() = p.block<3, 3>(bias, bias);
  }
  twist.diagonal().tail<3>() += 4.0 / (3.0 * duration * duration) * angle;
  const Matrix6d to_lidar = se3_adjoint(config_.lidar_from_imu);
  return to_lidar * twist * to_lidar.transpose();
}

std::optional<Prior> InertialPredictor::predict(const SweepStamps& sweep) {
  predicted_.reset();
  if (sweep.reference_ns < silent_until_ns_) return std::nullopt;
  const bool first = !state_ && !last_twist_;
  const std::int64_t from = first ? sweep.first_ns : std::min(sweep.first_ns, last_ns_);
  const std::int64_t to = std::max(sweep.last_ns, sweep.reference_ns);
  const bool later = first || sweep.reference_ns > last_ns_;
  usable_ = samples_.size();
  while (usable_ > 0 && samples_[usable_ - 1].stamp_ns > to) --usable_;
  if (!later || to - from > rest_ns || !covers(from, to)) {
    if (!samples_.empty()) ++counters_.uncovered;
    return std::nullopt;
  }
  if (first) last_ns_ = sweep.reference_ns;
  if (!state_) {
    state_ = at_rest(last_ns_);
    if (last_twist_) set_velocity(*state_, *last_twist_);
  }
  sample_sweep(sweep);
  predicted_ = *state_;
  advance(*predicted_, last_ns_, sweep.reference_ns, true);
  auto grow = predicted_->covariance.diagonal();
  grow.segment<3>(position).array() += config_.least_translation * config_.least_translation;
  grow.segment<3>(rotation).array() += config_.least_rotation * config_.least_rotation;
  ++counters_.predicted;

  Prior prior;
  prior.sweep = poses_;
  prior.sweep_covariance = sweep_covariance(sweep);
  if (first) return prior;
  const Pose& mounting = config_.lidar_from_imu;
  Pose imu = Pose::Identity();
  imu.linear() = predicted_->rotation;
  imu.translation() = predicted_->position;
  prior.pose = mounting * imu * mounting.inverse();
  prior.pose.linear() = orthonormalized(prior.pose.linear());
  // To the right perturbation of the LiDAR's motion.
  Matrix6d to_lidar = Matrix6d::Identity();
  to_lidar.topLeftCorner<3, 3>() = predicted_->rotation.transpose();
  to_lidar = se3_adjoint(mounting) * to_lidar;
  const Matrix6d covariance = to_lidar * predicted_->covariance.topLeftCorner<6, 6>() * to_lidar.transpose();
  prior.information = covariance.ldlt().solve(Matrix6d::Identity());
  prior.information = 0.5 * (prior.information + prior.information.transpose().eval());
  if (!prior.information.allFinite() || !is_rigid(prior.pose)) {
    state_.reset();
    predicted_.reset();
    return std::nullopt;
  }
  return prior;
}

// True, and the IMU is left out for a while, if what was found has been far from what was expected several times in a
// row.
bool InertialPredictor::contradicts(const Vector6d& found, const Matrix6d& expected) {
  if (found.dot(expected.ldlt().solve(found)) < contradiction) {
    contradictions_in_a_row_ = 0;
    return false;
  }
  ++counters_.contradicted;
  return ++contradictions_in_a_row_ >= contradictions_to_believe;
}

void InertialPredictor::note_surprise(const Vector6d& found, const Matrix6d& expected, double elapsed) {
  // A velocity that was open says nothing of how good the next ones are.
  if (!(elapsed > 0.0) || expected.diagonal().head<3>().maxCoeff() > known_position * known_position) {
    surprises_ = 0;
    return;
  }
  surprises_ = std::min(surprises_ + 1, lasting_surprises);
  if (surprises_ == 1) surprise2_.setZero();
  surprise2_ += ((found / elapsed).cwiseAbs2() - surprise2_) / surprises_;
}

void InertialPredictor::correct(const Estimate& estimate) {
  if (estimate.status == Status::bad_stamp || estimate.status == Status::bad_cloud) return;
  const Pose& mounting = config_.lidar_from_imu;
  const Pose imu = mounting.inverse() * (last_pose_.inverse() * estimate.pose) * mounting;
  last_pose_ = estimate.pose;
  const bool found = registered(estimate.status);
  last_twist_.reset();
  if (found) last_twist_ = estimate.twist;
  if (!predicted_) {
    surprises_ = 0;
    last_ns_ = estimate.stamp_ns;
    if (state_ && found) {
      state_->rotation = imu.linear();
      rebase(*state_);
      set_velocity(*state_, estimate.twist);
    } else {
      state_.reset();
    }
    return;
  }
  state_ = *predicted_;
  predicted_.reset();
  const double elapsed = seconds(last_ns_, estimate.stamp_ns);
  last_ns_ = estimate.stamp_ns;
  if (found) {
    Covariance& p = state_->covariance;
    Vector6d shift;
    shift << imu.translation() - state_->position, so3_log(state_->rotation.transpose() * imu.linear());
    const Matrix6d prior = p.topLeftCorner<6, 6>();
    note_surprise(shift, prior, elapsed);
    if (contradicts(shift, prior)) {
      silent_until_ns_ = last_ns_ + silence_ns;
      contradictions_in_a_row_ = surprises_ = 0;
      state_.reset();
      return;
    }
    // The pose's marginal goes to what the registration made of it; the other states follow.
    Matrix6d to_imu = Matrix6d::Identity();
    to_imu.topLeftCorner<3, 3>() = state_->rotation;
    to_imu = to_imu * se3_adjoint(mounting.inverse());
    const Matrix6d to_lidar = to_imu.inverse();
    const Matrix6d found_match = to_lidar.transpose() * estimate.information * to_lidar;
    // A velocity that was wrong distorted the sweep: the pose is off by half of what it was wrong by in one sweep.
    Vector6d distortion;
    distortion << Eigen::Vector3d::Constant(0.25 * shift.head<3>().squaredNorm() + 1e-8),
        Eigen::Vector3d::Constant(0.25 * shift.tail<3>().squaredNorm() + 1e-10);
    const Matrix6d sum = found_match + Matrix6d(distortion.cwiseInverse().asDiagonal());
    const Matrix6d match = found_match - found_match * sum.ldlt().solve(found_match);
    const Eigen::LDLT<Matrix6d> prior_factors(prior);
    const Matrix6d posterior = (prior_factors.solve(Matrix6d::Identity()) + match).ldlt().solve(Matrix6d::Identity());
    const Eigen::Matrix<double, states, 6> gain = prior_factors.solve(p.leftCols<6>().transpose()).transpose();
    const Eigen::Matrix<double, states, 1> step = gain * shift;
    const Covariance updated = p - gain * (prior - posterior) * gain.transpose();
    p = 0.5 * (updated + updated.transpose());
    state_->position += step.segment<3>(position);
    state_->rotation = orthonormalized(state_->rotation * so3_exp(step.segment<3>(rotation)));
    state_->velocity += step.segment<3>(velocity);
    state_->gravity += step.segment<3>(gravity);
    state_->gyro_bias += step.segment<3>(bias);
  }
  rebase(*state_);
}

}  // namespace adit::lidar_odometry
