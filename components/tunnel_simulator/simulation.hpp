// Runs a scenario: makes every sensor's samples in the order of their availability and hands them to a sink.
#pragma once

#include <memory>

#include "components/tunnel_simulator/scenario.hpp"

namespace adit::tunnel_simulator {

// How a sample reaches its consumer.
struct Delivery {
  std::uint64_t index = 0;      // of the sample, counting those that were lost
  double time = 0.0;            // true time it refers to (the stamp of a perfect clock), epoch included [s]
  std::int64_t stamp_ns = 0;    // what it is stamped with
  std::int64_t arrival_ns = 0;  // when it arrives, >= end of its measurement
  bool repeated = false;        // a frozen sensor's old sample
};

// Receives samples during Simulation::run, on the calling thread. References are valid during the call only.
class Sink {
 public:
  virtual ~Sink() = default;
  virtual void on_lidar(const LidarScan&, const Delivery&) {}
  virtual void on_thermal(const ThermalImage&, const Delivery&) {}
  virtual void on_imu(const ImuSample&, const Delivery&) {}
  virtual void on_gnss(const GnssSample&, const Delivery&) {}
  virtual void on_truth(double /*time*/, const Pose& /*world_base*/) {}  // 100 Hz
  virtual bool stop() { return false; }
};

class Simulation {
 public:
  // Fails when the world cannot be made (import missing) or the route leaves it.
  static Result<std::unique_ptr<Simulation>> create(Scenario scenario, int threads);
  ~Simulation();

  const Scenario& scenario() const;
  const World& world() const;
  const Motion& motion() const;
  const Route& route() const;
  RayCaster& caster();
  // World <- frame at a time since the start of the simulation [s].
  Pose base(double time) const;
  Pose lidar(double time) const;
  Pose thermal(double time) const;

  // Makes samples up to `until` seconds (at most the scenario's duration) and goes on where the last call stopped.
  void run(Sink& sink, double until);
  // Makes the next sample. When it is ready [s], or +inf at the end of the scenario, is `ready()`.
  void step(Sink& sink);
  double ready() const;

 private:
  struct Impl;
  explicit Simulation(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace adit::tunnel_simulator
