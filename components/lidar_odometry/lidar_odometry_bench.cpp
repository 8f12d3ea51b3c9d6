// CPU cost of a sweep of 1024 x 128 points, motion compensation and map update included, in a furnished and in a smooth
// tunnel; the three modes in one run, so that their ratios hold on a busy machine. Counters are milliseconds of process
// CPU time (all threads) over the sweeps, and linear systems solved.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>

#include "components/lidar_odometry/lidar_odometry.hpp"
#include "components/lidar_odometry/test_scene.hpp"

namespace adit::lidar_odometry {
namespace {

constexpr int sweep_count = 30;

// At rest for 3 sweeps, then with 3 m/s^2.
std::vector<RecordedSweep> drive(const Scene& scene) {
  ScannerModel model;
  model.rings = 128;
  model.columns = 1024;
  std::vector<RecordedSweep> sweeps;
  Pose pose = Pose::Identity();
  for (int k = 0; k < sweep_count; ++k) {
    Vector6d twist = Vector6d::Zero();
    twist[0] = std::clamp(0.3 * (k - 2), 0.0, 10.0);
    pose = pose * se3_exp(model.period * twist);
    sweeps.push_back(scan(scene, model, pose, twist, 0, static_cast<unsigned>(k)));
  }
  return sweeps;
}

const std::vector<RecordedSweep>& sweeps_of(bool smooth) {
  static const std::vector<RecordedSweep> furnished_sweeps = drive(furnished_tunnel(-25.0, 60.0));
  static const std::vector<RecordedSweep> smooth_sweeps = drive(smooth_tunnel());
  return smooth ? smooth_sweeps : furnished_sweeps;
}

void sweep(benchmark::State& state, Mode mode, bool smooth, int threads) {
  const std::vector<RecordedSweep>& sweeps = sweeps_of(smooth);
  Config config;
  config.mode = mode;
  config.threads = threads;
  LidarOdometry odometry(config);
  std::vector<double> milliseconds;
  double solves = 0.0;
  std::size_t k = 0;
  std::int64_t stamp = 0;
  for (auto _ : state) {
    if (k == sweeps.size()) {
      state.PauseTiming();
      odometry.reset();
      k = 0;
      state.ResumeTiming();
    }
    Cloud cloud = sweeps[k++].cloud();
    cloud.stamp_ns = stamp += 100'000'000;
    const std::clock_t begin = std::clock();
    const Estimate& estimate = odometry.process(cloud);
    milliseconds.push_back(1e3 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
    solves += estimate.scan.solves;
  }
  std::sort(milliseconds.begin(), milliseconds.end());
  state.counters["median_ms"] = milliseconds[milliseconds.size() / 2];
  state.counters["p95_ms"] = milliseconds[milliseconds.size() * 95 / 100];
  state.counters["max_ms"] = milliseconds.back();
  state.counters["solves"] = solves / static_cast<double>(milliseconds.size());
}

const bool registered_all = [] {
  for (const bool smooth : {false, true}) {
    for (const Mode mode : {Mode::default_, Mode::genz, Mode::kiss}) {
      for (const int threads : {1, 2}) {
        const std::string name = "lidar_odometry/" + std::string(to_string(mode)) +
                                 (smooth ? "/smooth" : "/furnished") + "/threads:" + std::to_string(threads);
        benchmark::RegisterBenchmark(name.c_str(), sweep, mode, smooth, threads)
            ->Iterations(sweep_count)
            ->Unit(benchmark::kMillisecond)
            ->MeasureProcessCPUTime();
      }
    }
  }
  return true;
}();

}  // namespace
}  // namespace adit::lidar_odometry

BENCHMARK_MAIN();
