#include "components/tunnel_simulator/simulation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "components/tunnel_simulator/mesh_import.hpp"
#include "components/tunnel_simulator/random.hpp"
#include "components/tunnel_simulator/traffic.hpp"

namespace adit::tunnel_simulator {

namespace {

constexpr std::size_t kTruth = kSensors;

// When and how samples of one sensor are handed on.
class Courier {
 public:
  Courier(const Scenario& scenario, Sensor sensor)
      : scenario_(scenario), sensor_(sensor), timing_(scenario.timing[static_cast<std::size_t>(sensor)]) {}

  // `true_time`: what the stamp refers to; `end`: when the measurement is complete. Simulation time [s].
  struct Verdict {
    Delivery delivery;
    bool deliver = true, render = true;
  };
  Verdict decide(std::uint64_t index, double true_time, double end) {
    const RandomStream random(scenario_.seed, 501 + static_cast<std::uint64_t>(sensor_), index);
    Verdict v;
    v.delivery.index = index;
    v.delivery.time = scenario_.epoch + true_time;
    double stamp = true_time + timing_.offset + timing_.jitter * random.normal(0);
    double arrival = end + random.uniform(1, timing_.latency_low, timing_.latency_high);
    bool lost = random.uniform(2) < timing_.loss;
    for (const Outage& o : scenario_.outages) {
      if (o.sensor != sensor_ || true_time < o.from || true_time >= o.from + o.duration) continue;
      if (o.mode == OutageMode::off) v.render = v.deliver = false;
      if (o.mode == OutageMode::frozen) {
        v.render = false;
        v.delivery.repeated = true;
      }
      if (o.mode == OutageMode::delayed) arrival += o.delay;
      if (o.mode == OutageMode::lossy && random.uniform(3) < o.loss) lost = true;
    }
    if (lost) v.deliver = false;
    const auto nanoseconds = [&](double t) { return std::llround((scenario_.epoch + t) * 1e9); };
    v.delivery.stamp_ns = nanoseconds(stamp);
    v.delivery.arrival_ns = std::max(nanoseconds(arrival), nanoseconds(end));
    return v;
  }

 private:
  const Scenario& scenario_;
  Sensor sensor_;
  Timing timing_;
};

}  // namespace

struct Simulation::Impl {
  Scenario scenario;
  int threads;
  World world;
  Route route;
  Motion motion;
  Atmosphere atmosphere;
  Traffic traffic;
  RayCaster caster;
  Lidar lidar;
  ThermalCamera thermal;
  Imu imu;
  Gnss gnss;
  std::vector<std::array<Pose, 2>> movers;
  std::array<Courier, kSensors> couriers;
  // The streams: one a sensor, and the truth.
  std::array<double, kSensors + 1> period, span;  // between samples; of one measurement [s]
  std::array<bool, kSensors + 1> on;
  std::array<std::uint64_t, kSensors + 1> index{};
  LidarScan scan;
  ThermalImage image;

  Impl(Scenario s, World w, int thread_count)
      : scenario(std::move(s)),
        threads(thread_count),
        world(std::move(w)),
        route(scenario.route, scenario.closed),
        motion(scenario.motion, route, scenario.duration + 1.0, scenario.seed),
        traffic(scenario.traffic),
        caster(world, {scenario.view_radius, scenario.thermal_on, threads},
               traffic.meshes(world.description().texture >= 3)),
        lidar(scenario.lidar, scenario.seed),
        thermal(scenario.thermal, scenario.seed),
        imu(scenario.imu, scenario.seed),
        gnss(scenario.gnss, world.description().origin, scenario.seed),
        couriers{Courier(scenario, Sensor::lidar), Courier(scenario, Sensor::thermal), Courier(scenario, Sensor::imu),
                 Courier(scenario, Sensor::gnss)},
        period{1.0 / scenario.lidar.rate, 1.0 / scenario.thermal.rate, 1.0 / scenario.imu.rate,
               1.0 / scenario.gnss.rate, 0.01},
        span{period[0], 2.0 * thermal.half_readout(), 0.0, 0.0, 0.0},
        on{scenario.lidar_on, scenario.thermal_on, scenario.imu_on, scenario.gnss_on, true} {
    for (const Smoke& smoke : scenario.smoke) {
      const std::size_t i = world.find(smoke.tube);
      if (i >= world.description().volumes.size()) continue;  // the loader has refused it
      const VolumeDescription& v = world.description().volumes[i];
      atmosphere.add_along(v.line, smoke.from, smoke.to, smoke.ramp, smoke.kind, smoke.visibility,
                           v.profile.width() + 2.0, v.profile.max().y());
    }
  }

  // The stream whose sample is ready first, and when.
  std::pair<std::size_t, double> next() const {
    std::pair<std::size_t, double> first{kTruth, std::numeric_limits<double>::infinity()};
    for (std::size_t i = 0; i <= kTruth; ++i) {
      const double end = static_cast<double>(index[i]) * period[i] + span[i];
      if (on[i] && end <= scenario.duration + 1e-9 && end < first.second - 1e-9) first = {i, end};
    }
    return first;
  }

  void look(double begin, double end, const Pose& from) {
    caster.look_from(from.translation());
    traffic.poses(begin, end, movers);
    caster.move(movers);
  }
};

Simulation::Simulation(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Simulation::~Simulation() = default;

Result<std::unique_ptr<Simulation>> Simulation::create(Scenario scenario, int threads) {
  std::optional<World> world;
  if (scenario.import.empty()) {
    world.emplace(scenario.world);
  } else {
    auto mesh = import_mesh(scenario.import);
    if (!mesh) return mesh.error();
    world.emplace(scenario.world, std::move(*mesh));
  }
  const Route route(scenario.route, scenario.closed);
  for (double d = 0.0; d < route.length(); d += 2.0) {
    const Eigen::Vector3d place = route.at(d).position + Eigen::Vector3d(0.0, 0.0, 1.5);
    if (world->field(place) > -0.5) {
      return Error{ErrorCode::invalid_argument, "the route leaves the tunnel " + std::to_string(static_cast<int>(d)) +
                                                    " m after its begin, at (" + std::to_string(place.x()) + ", " +
                                                    std::to_string(place.y()) + ")"};
    }
  }
  auto impl = std::make_unique<Impl>(std::move(scenario), std::move(*world), threads);
  return std::unique_ptr<Simulation>(new Simulation(std::move(impl)));
}

const Scenario& Simulation::scenario() const {
  return impl_->scenario;
}
const World& Simulation::world() const {
  return impl_->world;
}
const Motion& Simulation::motion() const {
  return impl_->motion;
}
const Route& Simulation::route() const {
  return impl_->route;
}
RayCaster& Simulation::caster() {
  return impl_->caster;
}
Pose Simulation::base(double time) const {
  return impl_->motion.pose(std::max(0.0, time));
}
Pose Simulation::lidar(double time) const {
  return base(time) * impl_->scenario.rig.lidar;
}
Pose Simulation::thermal(double time) const {
  return base(time) * impl_->scenario.rig.thermal;
}

double Simulation::ready() const {
  return impl_->next().second;
}

void Simulation::run(Sink& sink, double until) {
  while (!sink.stop() && ready() <= until + 1e-9) step(sink);
}

void Simulation::step(Sink& sink) {
  Impl& d = *impl_;
  const auto [stream, ready] = d.next();
  if (!std::isfinite(ready)) return;
  const std::uint64_t k = d.index[stream]++;
  const double begin = static_cast<double>(k) * d.period[stream];
  if (stream == kTruth) {
    sink.on_truth(d.scenario.epoch + begin, base(begin));
    return;
  }
  const auto sensor = static_cast<Sensor>(stream);
  const double time = begin + (sensor == Sensor::thermal ? 0.5 * d.span[stream] : 0.0);
  const Courier::Verdict verdict = d.couriers[stream].decide(k, time, ready);
  switch (sensor) {
    case Sensor::lidar:
      if (verdict.render && verdict.deliver) {
        d.look(begin, begin + d.period[stream], lidar(begin + 0.5 * d.period[stream]));
        d.lidar.sweep(
            d.caster, d.atmosphere, [this](double t) { return lidar(t); }, begin, k, d.threads, d.scan);
      }
      d.scan.stamp_ns = verdict.delivery.stamp_ns;
      if (verdict.deliver && !d.scan.ranges.empty()) sink.on_lidar(d.scan, verdict.delivery);
      break;
    case Sensor::thermal:
      if (verdict.render) {  // lost frames too: a closed shutter repeats the one before
        d.look(begin, begin + std::max(d.span[stream], 1e-3), thermal(begin));
        d.thermal.capture(
            d.caster, d.atmosphere, [this](double t) { return thermal(t); }, begin, k, d.threads, d.image);
      }
      d.image.stamp_ns = verdict.delivery.stamp_ns;
      if (verdict.deliver && !d.image.counts.empty()) sink.on_thermal(d.image, verdict.delivery);
      break;
    case Sensor::imu: {
      ImuSample sample = d.imu.sample([&](double t) { return base(t) * d.scenario.rig.imu; }, begin, k);
      sample.stamp_ns = verdict.delivery.stamp_ns;
      if (verdict.deliver) sink.on_imu(sample, verdict.delivery);
      break;
    }
    case Sensor::gnss: {
      const Eigen::Vector3d antenna = base(begin) * d.scenario.rig.antenna;
      GnssSample sample = d.gnss.sample(antenna, d.world.depth_from_portal(antenna), begin, k);
      sample.stamp_ns = verdict.delivery.stamp_ns;
      if (verdict.deliver) sink.on_gnss(sample, verdict.delivery);
      break;
    }
  }
}

}  // namespace adit::tunnel_simulator
