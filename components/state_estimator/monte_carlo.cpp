#include "components/state_estimator/monte_carlo.hpp"

#include <numbers>

#include <Eigen/Cholesky>

#include "components/state_estimator/correction.hpp"
#include "components/state_estimator/measurement_models.hpp"

namespace adit::state_estimator::test {
namespace {

// Normalized squared error of some states.
template <int N>
double nees(const FilterState& s, const StateVector& truth, const int (&indices)[N]) {
  Eigen::Matrix<double, N, 1> error;
  Eigen::Matrix<double, N, N> p;
  for (int i = 0; i < N; ++i) {
    error(i) = s.x(indices[i]) - truth(indices[i]);
    if (indices[i] == kYaw) error(i) = wrap_angle(error(i));
    for (int j = 0; j < N; ++j) p(i, j) = s.p(indices[i], indices[j]);
  }
  return error.dot(p.ldlt().solve(error));
}

constexpr double kStart[kCoreStates] = {0.01, 0.01, 0.5, 0.5, 0.005, 0.05, 0.05};  // initial deviations
constexpr double kStartScale = 0.05, kStartBias = 0.002;

Filter make_filter(const MonteCarloConfig& mc) {
  Filter filter;
  filter.process.noise.jerk = 0.5;
  filter.process.noise.yaw_jerk = 0.002;
  filter.process.noise.diagonal = mc.diagonal_noise;
  filter.process.noise.scale = filter.process.noise.thermal_yaw_bias = 0.0;
  for (const bool calibrated : {false, mc.calibration}) {
    SensorModel sensor;
    sensor.model = std::make_unique<SpeedAndYawRate>(OdometryCalibration{.scale = calibrated, .yaw_bias = calibrated});
    sensor.moves = true;
    sensor.scaled = calibrated;
    filter.add_sensor(std::move(sensor));
  }
  return filter;
}

}  // namespace

MonteCarloResult monte_carlo(const MonteCarloConfig& mc) {
  constexpr int full[7] = {kX, kY, kSpeed, kAccel, kYaw, kYawRate, kYawAccel};
  constexpr int nine[9] = {kX, kY, kSpeed, kAccel, kYaw, kYawRate, kYawAccel, kScale, kThermalYawBias};
  constexpr int pose[3] = {kX, kY, kYaw};
  constexpr int motion[2] = {kSpeed, kYawRate};
  const Filter filter = make_filter(mc);
  MonteCarloResult result;
  result.nees.assign(static_cast<std::size_t>(mc.seconds), 0.0);
  double nis = 0.0, nis_count = 0.0, yaw_squares = 0.0, position_squares = 0.0;
  double correlation[11] = {};
  for (int run = 0; run < mc.runs; ++run) {
    Drive drive({}, 1000 + static_cast<std::uint64_t>(run));
    // The filter starts off the truth by what its initial covariance says.
    FilterState start;
    start.stamp_ns = 0;
    for (int i = 0; i < kCoreStates; ++i) {
      start.x(i) = drive.state()(i) + kStart[i] * drive.noise();
      start.p(i, i) = kStart[i] * kStart[i];
    }
    double scale = 1.0, bias = 0.0;
    if (mc.calibration) {
      scale = std::exp(kStartScale * drive.noise());
      bias = kStartBias * drive.noise();
      start.p(kScale, kScale) = kStartScale * kStartScale;
      start.p(kThermalYawBias, kThermalYawBias) = kStartBias * kStartBias;
    }
    ReplayBuffer buffer(filter, {.history_s = 1.0});
    buffer.restart(start);
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    std::vector<Measurement> late;
    std::vector<Eigen::Vector2d> innovations;
    for (int tick = 1; tick <= 30 * mc.seconds; ++tick) {
      const std::int64_t t = tick * kSecond / 30;
      drive.advance_to(t);
      const CoreVector& x = drive.state();
      Measurement thermal =
          rates(1, t, scale * x(kSpeed) + mc.thermal_sigma_v * drive.noise(),
                x(kYawRate) + bias + mc.thermal_sigma_w * drive.noise(), mc.thermal_sigma_v, mc.thermal_sigma_w);
      if (tick % 3 == 0) {
        Measurement lidar = rates(0, t, x(kSpeed) + mc.lidar_sigma_v * drive.noise(),
                                  x(kYawRate) + mc.lidar_sigma_w * drive.noise(), mc.lidar_sigma_v, mc.lidar_sigma_w);
        const FilterState before = *buffer.state_at(t);
        const Innovation innovation = project(before, SpeedAndYawRate().linearize(before, lidar), lidar);
        const Eigen::Matrix2d s = (innovation.predicted + innovation.covariance).topLeftCorner<2, 2>();
        innovations.push_back(s.llt().matrixL().solve(innovation.value.head<2>()));
        buffer.insert(lidar);
        ++result.updates;
      }
      if (uniform(drive.random()) < mc.out_of_order) {
        late.push_back(thermal);
      } else {
        buffer.insert(thermal);
      }
      ++result.updates;
      for (std::size_t i = 0; i < late.size();) {
        if (late[i].stamp_ns > t - 50 * kMillisecond) {
          ++i;
          continue;
        }
        buffer.insert(late[i]);
        late.erase(late.begin() + static_cast<std::ptrdiff_t>(i));
      }
      if (tick % 30 != 0) continue;
      StateVector truth = StateVector::Zero();
      truth.head<kCoreStates>() = x;
      truth(kScale) = std::log(scale);
      truth(kThermalYawBias) = bias;
      const FilterState state = *buffer.state_at(t);
      const double value = mc.calibration ? nees(state, truth, nine) : nees(state, truth, full);
      result.nees[static_cast<std::size_t>(tick / 30 - 1)] += value / mc.runs;
      const double weight = 1.0 / (mc.runs * mc.seconds);
      result.nees_mean += value * weight;
      result.pose_nees_mean += nees(state, truth, pose) * weight;
      result.motion_nees_mean += nees(state, truth, motion) * weight;
      if (tick == 30 * mc.seconds) {
        yaw_squares += std::pow(wrap_angle(state.x(kYaw) - x(kYaw)), 2) / mc.runs;
        position_squares += (state.x.head<2>() - x.head<2>()).squaredNorm() / mc.runs;
      }
    }
    for (int i = 0; i < 2; ++i) {
      const SensorState& s = buffer.head().sensors[static_cast<std::size_t>(i)];
      nis += s.nis_per_dof_sum;
      nis_count += static_cast<double>(s.examined);
    }
    for (int lag = 1; lag <= 10; ++lag) {
      double sum = 0.0;
      for (std::size_t i = static_cast<std::size_t>(lag); i < innovations.size(); ++i) {
        sum += innovations[i].dot(innovations[i - static_cast<std::size_t>(lag)]) / 2.0;
      }
      correlation[lag] += sum / static_cast<double>(innovations.size()) / mc.runs;
    }
  }
  const double dof = mc.calibration ? 9.0 : 7.0;
  const double band = 1.96 * std::sqrt(2.0 * dof / mc.runs);
  for (const double value : result.nees) {
    result.inside += std::abs(value - dof) <= band ? 1.0 / mc.seconds : 0.0;
  }
  for (int lag = 1; lag <= 10; ++lag) {
    result.largest_autocorrelation = std::max(result.largest_autocorrelation, std::abs(correlation[lag]));
  }
  result.nis_per_dof = nis / nis_count;
  result.yaw_rms_deg = std::sqrt(yaw_squares) * 180.0 / std::numbers::pi;
  result.position_rms_m = std::sqrt(position_squares);
  return result;
}

}  // namespace adit::state_estimator::test
