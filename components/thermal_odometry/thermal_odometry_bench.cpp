// Cost of a frame, 640 x 512, one thread: thread CPU time of frames that are tracked and of frames that become
// keyframes, with LiDAR, without, and for the parts of the front end.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <vector>

#include "components/thermal_odometry/test_scene.hpp"
#include "components/thermal_odometry/thermal_odometry.hpp"

namespace adit::thermal_odometry {
namespace {

double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

TestScene large_scene() {
  TestScene scene;
  scene.camera = {640, 512, 417.0, 417.0, 319.5, 255.5, Distortion::none, {}};
  return scene;
}

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (double value : values) sum += value;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

void frames(benchmark::State& state, Mode mode, bool bilateral) {
  const int count = 100;
  const double speed = 10.0;
  for (auto _ : state) {
    TestScene scene = large_scene();
    Config config;
    config.mode = mode;
    config.front_end.bilateral = bilateral;
    auto odometry = ThermalOdometry::create(scene.camera, config);
    std::vector<double> tracked;
    std::vector<double> keyframes;
    int points = 0;
    int measured = 0;
    for (int i = 0; i < count; ++i) {
      const Pose pose = TestScene::drive(0.0333 * i, speed);
      const auto stamp = static_cast<std::int64_t>(33.3e6 * i);
      const Frame frame = scene.render(pose, stamp);
      const bool scan = mode == Mode::anchored && i % 3 == 0;
      const DepthPoints cloud = scan ? scene.scan(pose, stamp) : DepthPoints{};
      const double before = cpu_ms();
      const Estimate& estimate = (*odometry)->process(frame, nullptr, scan ? &cloud : nullptr);
      const double took = cpu_ms() - before;
      if (!estimate.measured) continue;
      (estimate.new_keyframe ? keyframes : tracked).push_back(took);
      points += estimate.points;
      ++measured;
    }
    state.counters["tracked_ms"] = mean(tracked);
    state.counters["tracked_p99_ms"] = quantile(tracked, 0.99);
    state.counters["keyframe_ms"] = mean(keyframes);
    state.counters["keyframe_max_ms"] = quantile(keyframes, 1.0);
    state.counters["keyframes_per_s"] = static_cast<double>(keyframes.size()) / (0.0333 * count);
    state.counters["points"] = static_cast<double>(points) / std::max(1, measured);
    state.counters["measured"] = measured;
  }
}

BENCHMARK_CAPTURE(frames, anchored, Mode::anchored, true)->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(frames, anchored_no_bilateral, Mode::anchored, false)->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(frames, mono, Mode::mono, true)->Iterations(1)->Unit(benchmark::kMillisecond);

void front_end(benchmark::State& state, bool destripe, bool bilateral) {
  TestScene scene = large_scene();
  FrontEnd front(scene.camera, {.noise_counts = 2.5F, .destripe = destripe, .bilateral = bilateral});
  const Frame frame = scene.render(Pose::Identity(), 0);
  front.calibrate(frame);
  Pyramid pyramid;
  pyramid.allocate(640, 512);
  for (auto _ : state) front.process(frame, pyramid);
}
BENCHMARK_CAPTURE(front_end, plain, false, false)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(front_end, destripe, true, false)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(front_end, bilateral, false, true)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace adit::thermal_odometry

BENCHMARK_MAIN();
