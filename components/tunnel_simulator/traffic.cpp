#include "components/tunnel_simulator/traffic.hpp"

#include <cmath>

namespace adit::tunnel_simulator {

Mesh vehicle_mesh(bool truck, bool thermal) {
  Mesh mesh;
  const auto surface = [&](Material material, double heat) {
    return mesh.add_surface({material, false, thermal ? static_cast<float>(heat) : 0.0F, 1.0F});
  };
  const Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  const std::uint32_t body = surface(Material::painted_metal, 1.0);
  const std::uint32_t glass = surface(Material::glass, 2.0);
  const std::uint32_t tyre = surface(Material::rubber, 15.0);
  const std::uint32_t warm = surface(Material::painted_metal, 12.0);
  const std::uint32_t exhaust = surface(Material::painted_metal, 50.0);
  const std::uint32_t plate = surface(Material::sign, 1.0);
  const double length = truck ? 12.0 : 4.5;
  const double width = truck ? 2.5 : 1.8;
  if (truck) {
    mesh.add_box({-1.2, 0.0, 2.3}, axes, {9.4, width, 2.8}, body);
    mesh.add_box({4.9, 0.0, 1.8}, axes, {2.2, width, 2.4}, body);
    mesh.add_box({6.01, 0.0, 2.4}, axes, {0.02, 2.2, 0.9}, glass);
    mesh.add_box({6.01, 0.0, 1.2}, axes, {0.02, 2.0, 0.8}, warm);
  } else {
    mesh.add_box({0.0, 0.0, 0.6}, axes, {length, width, 0.7}, body);
    mesh.add_box({-0.3, 0.0, 1.2}, axes, {2.4, 1.6, 0.5}, glass);
    mesh.add_box({1.6, 0.0, 0.96}, axes, {1.1, 1.6, 0.04}, warm);
  }
  mesh.add_box({-length / 2.0 - 0.02, 0.0, 0.7}, axes, {0.02, 0.5, 0.12}, plate);
  mesh.add_box({-length / 2.0 - 0.05, -0.5, 0.3}, axes, {0.15, 0.1, 0.1}, exhaust);
  const double radius = truck ? 0.5 : 0.32;
  for (double x : {-0.32 * length, 0.32 * length}) {
    for (double y : {-0.5 * width, 0.5 * width}) {
      mesh.add_cylinder({x, y - 0.11, radius}, {x, y + 0.11, radius}, radius, radius, 16, tyre);
    }
  }
  return mesh;
}

Traffic::Traffic(const std::vector<TrafficVehicle>& vehicles) {
  for (const TrafficVehicle& v : vehicles) vehicles_.push_back({v, Route({v.leg}, false)});
}

std::vector<Mesh> Traffic::meshes(bool thermal) const {
  std::vector<Mesh> out;
  for (const Vehicle& v : vehicles_) out.push_back(vehicle_mesh(v.description.truck, thermal));
  return out;
}

Pose Traffic::pose(const Vehicle& vehicle, double distance) const {
  const RoutePoint p = vehicle.route.at(distance);
  Pose pose = Pose::Identity();
  const Eigen::Vector3d left = Eigen::Vector3d::UnitZ().cross(p.tangent).normalized();
  pose.linear() << p.tangent, left, p.tangent.cross(left);
  pose.translation() = p.position;
  return pose;
}

void Traffic::poses(double begin, double end, std::vector<std::array<Pose, 2>>& out) const {
  out.clear();
  for (const Vehicle& v : vehicles_) {
    const double length = v.route.length();
    const double travelled = v.description.start + v.description.speed * begin;
    const double from = travelled - length * std::floor(travelled / length);
    const double to = std::min(length, from + v.description.speed * (end - begin));
    out.push_back({pose(v, from), pose(v, to)});
  }
}

}  // namespace adit::tunnel_simulator
