// Cost of a frame, 640 x 512, one thread: thread CPU time of frames that are tracked and of frames that become
// keyframes, with LiDAR, without, and for the parts of the front end.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <fstream>
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

// Of this process, MB.
double resident_mb() {
  std::ifstream statm("/proc/self/statm");
  double pages = 0.0;
  statm >> pages >> pages;
  return pages * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

// What the odometry sees of a drive at 10 m/s, 30 Hz, made beforehand: rendering must not warm or cool its caches.
struct Drive {
  static constexpr int count = 90;
  static constexpr double period = 0.0333;
  TestScene scene = large_scene();
  std::vector<std::vector<std::uint16_t>> pictures;
  std::vector<std::vector<Eigen::Vector3f>> clouds;  // every third frame

  Drive() {
    for (int i = 0; i < count; ++i) {
      const Pose pose = TestScene::drive(period * i, 10.0);
      const Frame frame = scene.render(pose, 0);
      pictures.emplace_back(frame.data, frame.data + static_cast<std::ptrdiff_t>(frame.width) * frame.height);
      const DepthPoints scan = i % 3 == 0 ? scene.scan(pose, 0) : DepthPoints{};
      clouds.emplace_back(scan.points.begin(), scan.points.end());
    }
  }
};

// Front end and tracking together are `tracked`, as a frame costs; the front end is timed again by itself, and the
// difference is `tracking`.
void frames(benchmark::State& state, Mode mode, int points, bool bilateral) {
  static const Drive drive;
  const CameraModel& camera = drive.scene.camera;
  for (auto _ : state) {
    Config config;
    config.mode = mode;
    config.mapper.selection.wanted = points;
    config.front_end.bilateral = bilateral;
    FrontEnd front(camera, config.front_end);
    Pyramid pyramid;
    pyramid.allocate(camera.width, camera.height);
    const double before_mb = resident_mb();
    auto odometry = ThermalOdometry::create(camera, config);
    std::vector<double> tracked, tracking, keyframes;
    double used = 0.0;
    int later_keyframes = 0;  // after the first second, in which the map is begun
    for (int i = 0; i < Drive::count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const auto stamp = static_cast<std::int64_t>(1e9 * Drive::period * i);
      const Frame frame{drive.pictures[k].data(), camera.width, camera.height, 0, stamp, FfcState::unknown};
      const bool scan = mode == Mode::anchored && i % 3 == 0;
      const DepthPoints cloud{drive.clouds[k], {}, stamp, TestScene::extrinsics()};
      const double begin = cpu_ms();
      const Estimate& estimate = (*odometry)->process(frame, nullptr, scan ? &cloud : nullptr);
      const double middle = cpu_ms();
      if (i == 0) front.calibrate(frame);
      front.process(frame, pyramid);
      const double front_ms = cpu_ms() - middle;
      if (!estimate.measured) continue;
      (estimate.new_keyframe ? keyframes : tracked).push_back(middle - begin);
      if (!estimate.new_keyframe) tracking.push_back(middle - begin - front_ms);
      used += estimate.points;
      later_keyframes += estimate.new_keyframe && Drive::period * i >= 1.0 ? 1 : 0;
    }
    const std::size_t measured = tracked.size() + keyframes.size();
    state.counters["tracked_ms"] = mean(tracked);
    state.counters["tracked_p99_ms"] = quantile(tracked, 0.99);
    state.counters["tracking_ms"] = mean(tracking);
    state.counters["tracking_p99_ms"] = quantile(tracking, 0.99);
    state.counters["keyframe_ms"] = mean(keyframes);
    state.counters["keyframe_max_ms"] = quantile(keyframes, 1.0);
    state.counters["keyframes_per_s"] = static_cast<double>(keyframes.size()) / (Drive::period * Drive::count);
    state.counters["later_keyframes_per_s"] = later_keyframes / (Drive::period * Drive::count - 1.0);
    state.counters["points"] = used / static_cast<double>(std::max<std::size_t>(1, measured));
    state.counters["measured"] = static_cast<double>(measured);
    state.counters["library_mb"] = resident_mb() - before_mb;
  }
}

BENCHMARK_CAPTURE(frames, anchored_500, Mode::anchored, 500, true)->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(frames, anchored_900, Mode::anchored, 900, true)->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(frames, anchored_no_bilateral, Mode::anchored, 500, false)
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(frames, mono_500, Mode::mono, 500, true)->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(frames, mono_900, Mode::mono, 900, true)->Iterations(1)->Unit(benchmark::kMillisecond);

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
