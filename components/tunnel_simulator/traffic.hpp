// Other vehicles: their shape and where they are.
#pragma once

#include <array>
#include <vector>

#include "components/tunnel_simulator/mesh.hpp"
#include "components/tunnel_simulator/scenario.hpp"

namespace adit::tunnel_simulator {

// In its own frame: x forward, origin on the road below the middle. Warm tyres, bonnet and exhaust when `thermal`.
Mesh vehicle_mesh(bool truck, bool thermal);

class Traffic {
 public:
  explicit Traffic(const std::vector<TrafficVehicle>& vehicles);
  std::vector<Mesh> meshes(bool thermal) const;
  // World <- vehicle at the two ends of an interval [s]. A vehicle that would jump back to its begin within the
  // interval stands still at its end instead.
  void poses(double begin, double end, std::vector<std::array<Pose, 2>>& out) const;

 private:
  struct Vehicle {
    TrafficVehicle description;
    Route route;
  };
  Pose pose(const Vehicle& vehicle, double distance) const;
  std::vector<Vehicle> vehicles_;
};

}  // namespace adit::tunnel_simulator
