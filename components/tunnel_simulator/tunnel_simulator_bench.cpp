// Speed of the sensors beside a bare loop over the same rays in the same scene. Run alone on the machine for figures.
#include <benchmark/benchmark.h>

#include <algorithm>

#include "components/tunnel_simulator/parallel.hpp"
#include "components/tunnel_simulator/scenario_loader.hpp"
#include "components/tunnel_simulator/simulation.hpp"

namespace adit::tunnel_simulator {
namespace {

const std::string kScenario = std::string(ADIT_SOURCE_DIR) + "/bringup/scenarios/s01_zab_round_trip.yaml";
constexpr double kTime = 25.0;  // in the road tube

Simulation& simulation() {
  static std::unique_ptr<Simulation> instance = [] {
    auto scenario = load_scenario(kScenario);
    auto made = Simulation::create(std::move(*scenario), 2);
    (*made)->caster().look_from((*made)->lidar(kTime).translation());
    return std::move(*made);
  }();
  return *instance;
}

void count_rays(benchmark::State& state, double rays) {
  state.counters["Mrays/s"] = benchmark::Counter(1e-6 * rays, benchmark::Counter::kIsIterationInvariantRate);
}

// The packets of a sweep or a frame, made beforehand; cast only.
void bare(benchmark::State& state, std::vector<RayPacket> packets) {
  const RayCaster& caster = simulation().caster();
  const auto threads = static_cast<int>(state.range(0));
  const std::size_t block = 64;
  for (auto _ : state) {
    parallel_for(threads, packets.size() / block, [&](std::size_t b) {
      for (std::size_t i = b * block; i < (b + 1) * block; ++i) {
        RayPacket packet = packets[i];
        caster.cast(packet);
        benchmark::DoNotOptimize(packet.far);
      }
    });
  }
  count_rays(state, static_cast<double>(packets.size() * kPacket));
}

RayPacket packet_from(const Eigen::Vector3d& from) {
  RayPacket packet;
  packet.time.fill(0.5F);
  packet.far.fill(150.0F);
  packet.ox.fill(static_cast<float>(from.x()));
  packet.oy.fill(static_cast<float>(from.y()));
  packet.oz.fill(static_cast<float>(from.z()));
  return packet;
}

void bare_lidar(benchmark::State& state) {
  const LidarConfig& c = simulation().scenario().lidar;
  const Pose pose = simulation().lidar(kTime);
  std::vector<RayPacket> packets;
  for (int c0 = 0; c0 < 1024; c0 += 4) {
    for (int r0 = 0; r0 < 128; r0 += 4) {
      RayPacket packet = packet_from(pose.translation() - simulation().caster().origin());
      for (std::size_t lane = 0; lane < kPacket; ++lane) {
        const double azimuth = 3.14159265 - 2.0 * 3.14159265 * (c0 + static_cast<int>(lane % 4)) / 1024.0;
        const double elevation = c.beams.elevation[static_cast<std::size_t>(r0) + lane / 4];
        const Eigen::Vector3d d =
            pose.linear() * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                            std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
        packet.dx[lane] = static_cast<float>(d.x());
        packet.dy[lane] = static_cast<float>(d.y());
        packet.dz[lane] = static_cast<float>(d.z());
      }
      packets.push_back(packet);
    }
  }
  bare(state, std::move(packets));
}

void bare_thermal(benchmark::State& state) {
  const CameraModel& m = simulation().scenario().thermal.camera;
  const Pose pose = simulation().thermal(kTime);
  std::vector<RayPacket> packets;
  for (int y0 = 0; y0 < m.height; y0 += 4) {
    for (int x0 = 0; x0 < m.width; x0 += 4) {
      RayPacket packet = packet_from(pose.translation() - simulation().caster().origin());
      for (std::size_t lane = 0; lane < kPacket; ++lane) {
        const Eigen::Vector3d d =
            pose.linear() * m.ray({x0 + static_cast<double>(lane % 4), y0 + static_cast<double>(lane / 4)});
        packet.dx[lane] = static_cast<float>(d.x());
        packet.dy[lane] = static_cast<float>(d.y());
        packet.dz[lane] = static_cast<float>(d.z());
      }
      packets.push_back(packet);
    }
  }
  bare(state, std::move(packets));
}

void lidar_sweep(benchmark::State& state) {
  LidarConfig c = simulation().scenario().lidar;
  c.noise = c.edges = state.range(1) != 0;
  Lidar lidar(c, 1);
  LidarScan scan;
  std::uint64_t frame = 0;
  const auto sweep = [&] {
    lidar.sweep(
        simulation().caster(), {}, [](double t) { return simulation().lidar(t); }, kTime, frame++,
        static_cast<int>(state.range(0)), scan);
  };
  sweep();  // the textures are baked when they are first seen
  for (auto _ : state) sweep();
  count_rays(state, 131072.0);
}

void thermal_frame(benchmark::State& state) {
  ThermalConfig c = simulation().scenario().thermal;
  const bool effects = state.range(1) != 0;
  c.noise = c.edges = effects;
  if (!effects) c.blur = c.time_constant = c.row_time = 0.0;
  c.ffc_first = -1.0;
  ThermalCamera camera(c, 1);
  ThermalImage image;
  std::uint64_t frame = 0;
  const auto capture = [&] {
    camera.capture(
        simulation().caster(), {}, [](double t) { return simulation().thermal(t); }, kTime, frame++,
        static_cast<int>(state.range(0)), image);
  };
  capture();
  for (auto _ : state) capture();
  count_rays(state, 327680.0);
}

// Two seconds of the scenario, OS2 at 10 Hz and camera at 30 Hz, with the making of new chunks.
void real_time_factor(benchmark::State& state) {
  const auto threads = static_cast<int>(state.range(0));
  for (auto _ : state) {
    state.PauseTiming();
    auto scenario = load_scenario(kScenario);
    scenario->duration = 60.0;
    scenario->motion.standing = 0.0;
    auto made = Simulation::create(std::move(*scenario), threads);
    Sink sink;
    (*made)->run(sink, 0.1);  // the first chunks
    state.ResumeTiming();
    (*made)->run(sink, 4.0);
  }
  state.counters["real_time_factor"] = benchmark::Counter(4.0, benchmark::Counter::kIsIterationInvariantRate);
}

// Wall time beside the CPU time of all threads.
void one_or_two_threads(benchmark::internal::Benchmark* one) {
  one->ArgName("threads")->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();
}
void with_and_without_effects(benchmark::internal::Benchmark* one) {
  one->ArgNames({"threads", "effects"})
      ->ArgsProduct({{1, 2}, {0, 1}})
      ->Unit(benchmark::kMillisecond)
      ->MeasureProcessCPUTime()
      ->UseRealTime();
}

BENCHMARK(bare_lidar)->Apply(one_or_two_threads);
BENCHMARK(lidar_sweep)->Apply(with_and_without_effects);
BENCHMARK(bare_thermal)->Apply(one_or_two_threads);
BENCHMARK(thermal_frame)->Apply(with_and_without_effects);
BENCHMARK(real_time_factor)->Apply(one_or_two_threads)->Unit(benchmark::kSecond)->Iterations(1);

}  // namespace
}  // namespace adit::tunnel_simulator

BENCHMARK_MAIN();
