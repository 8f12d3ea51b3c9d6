// Updates per second on one core: in order, late, with relative poses, and what an output costs.
#include <benchmark/benchmark.h>

#include "components/state_estimator/measurement_models.hpp"
#include "components/state_estimator/test_support.hpp"

namespace adit::state_estimator {
namespace {

using test::kMillisecond;
using test::kSecond;

std::unique_ptr<StateEstimator> estimator(bool imu) {
  Config config = Config::standard();
  config.imu.enabled = imu;
  std::unique_ptr<StateEstimator> e = std::move(*StateEstimator::create(config));
  e->start(0);
  return e;
}

OdometrySample on_circle(std::int64_t t) {
  const double angle = 0.1 * seconds_between(0, t);
  OdometrySample s;
  s.stamp_ns = t;
  s.pose = test::planar(20.0 * std::sin(angle), 20.0 * (1.0 - std::cos(angle)), angle);
  return s;
}

// (v, psi') pairs straight into filter and history, every 33 ms, each the newest.
void rates_in_order(benchmark::State& state) {
  Filter filter;
  SensorModel sensor;
  sensor.model = std::make_unique<SpeedAndYawRate>();
  sensor.moves = true;
  filter.add_sensor(std::move(sensor));
  ReplayBuffer buffer(filter, {});
  FilterState start;
  start.stamp_ns = 0;
  start.p.diagonal().head<kCoreStates>().setConstant(0.1);
  buffer.restart(start);
  std::int64_t t = 0;
  for (auto _ : state) {
    t += 33 * kMillisecond;
    buffer.insert(test::rates(0, t, 5.0, 0.1, 0.1, 0.01));
  }
  benchmark::DoNotOptimize(buffer.head().x.sum());
  state.SetItemsProcessed(state.iterations());
}

// LiDAR at 10 Hz and thermal at 30 Hz as relative poses with cloning; the LiDAR 50 ms late, so that it re-plays.
void odometry_standard(benchmark::State& state) {
  std::unique_ptr<StateEstimator> e = estimator(false);
  const std::int64_t lidar_delay = state.range(0) * kMillisecond;
  std::int64_t now = 0;
  std::int64_t updates = 0;
  for (auto _ : state) {
    now += 33 * kMillisecond;
    e->add_odometry(1, on_circle(now), now);
    ++updates;
    if (now % (99 * kMillisecond) != 0) continue;
    e->add_odometry(0, on_circle(now - lidar_delay), now);
    ++updates;
  }
  state.SetItemsProcessed(updates);
}

void imu_updates(benchmark::State& state) {
  std::unique_ptr<StateEstimator> e = estimator(true);
  ImuSample imu;
  imu.stamp_ns = 0;
  imu.specific_force.z() = 9.81;
  imu.angular_rate.z() = 0.1;
  for (auto _ : state) {
    imu.stamp_ns += 5 * kMillisecond;
    e->add_imu(imu, imu.stamp_ns);
  }
  state.SetItemsProcessed(state.iterations());
}

void output(benchmark::State& state) {
  std::unique_ptr<StateEstimator> e = estimator(false);
  for (std::int64_t t = 0; t < 5 * kSecond; t += 100 * kMillisecond) e->add_odometry(0, on_circle(t), t);
  for (auto _ : state) benchmark::DoNotOptimize(e->estimate(5 * kSecond + 20 * kMillisecond));
}

void relative_prediction(benchmark::State& state) {
  std::unique_ptr<StateEstimator> e = estimator(false);
  for (std::int64_t t = 0; t < 5 * kSecond; t += 33 * kMillisecond)
    e->add_odometry(static_cast<int>(t % 2), on_circle(t), t);
  for (auto _ : state) benchmark::DoNotOptimize(e->predict_motion(5 * kSecond - 100 * kMillisecond, 5 * kSecond));
}

BENCHMARK(rates_in_order);
BENCHMARK(odometry_standard)->Arg(0)->Arg(50)->Arg(500);
BENCHMARK(imu_updates);
BENCHMARK(output);
BENCHMARK(relative_prediction);

}  // namespace
}  // namespace adit::state_estimator

BENCHMARK_MAIN();
