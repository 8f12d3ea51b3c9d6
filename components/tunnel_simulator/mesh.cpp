#include "components/tunnel_simulator/mesh.hpp"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace adit::tunnel_simulator {

std::uint32_t Mesh::add_surface(const Surface& surface) {
  surfaces.push_back(surface);
  return static_cast<std::uint32_t>(surfaces.size() - 1);
}

void Mesh::add_quad(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                    const Eigen::Vector3d& d, std::uint32_t surface) {
  const auto first = static_cast<std::uint32_t>(vertices.size());
  for (const Eigen::Vector3d& p : {a, b, c, d}) vertices.push_back({p});
  triangles.push_back({first, first + 1, first + 2, surface});
  triangles.push_back({first, first + 2, first + 3, surface});
}

void Mesh::add_hexahedron(const std::array<Eigen::Vector3d, 8>& corners, std::uint32_t surface) {
  const auto first = static_cast<std::uint32_t>(vertices.size());
  for (const Eigen::Vector3d& p : corners) vertices.push_back({p});
  static constexpr std::array<std::array<std::uint32_t, 4>, 6> kFaces{
      {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}};
  for (const auto& f : kFaces) {
    triangles.push_back({first + f[0], first + f[1], first + f[2], surface});
    triangles.push_back({first + f[0], first + f[2], first + f[3], surface});
  }
}

void Mesh::add_box(const Eigen::Vector3d& centre, const Eigen::Matrix3d& axes, const Eigen::Vector3d& size,
                   std::uint32_t surface) {
  std::array<Eigen::Vector3d, 8> corners;
  for (std::size_t i = 0; i < 8; ++i) {
    const Eigen::Vector3d half((i & 1U) != 0U ? 0.5 : -0.5, (i & 2U) != 0U ? 0.5 : -0.5, (i & 4U) != 0U ? 0.5 : -0.5);
    corners[i] = centre + axes * half.cwiseProduct(size);
  }
  add_hexahedron(corners, surface);
}

void Mesh::add_cylinder(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius_from, double radius_to,
                        int sides, std::uint32_t surface) {
  const Eigen::Vector3d axis = (to - from).normalized();
  const Eigen::Vector3d across = axis.unitOrthogonal();
  const Eigen::Vector3d third = axis.cross(across);
  const auto first = static_cast<std::uint32_t>(vertices.size());
  vertices.push_back({from});
  vertices.push_back({to});
  for (int i = 0; i < sides; ++i) {
    const double a = 2.0 * std::numbers::pi * i / sides;
    const Eigen::Vector3d out = std::cos(a) * across + std::sin(a) * third;
    vertices.push_back({from + radius_from * out});
    vertices.push_back({to + radius_to * out});
  }
  for (int i = 0; i < sides; ++i) {
    const auto p = first + 2 + 2 * static_cast<std::uint32_t>(i);
    const auto q = first + 2 + 2 * static_cast<std::uint32_t>((i + 1) % sides);
    triangles.push_back({first, q, p, surface});
    triangles.push_back({p, q, p + 1, surface});
    if (radius_to > 0.0) {
      triangles.push_back({q, q + 1, p + 1, surface});
      triangles.push_back({first + 1, p + 1, q + 1, surface});
    }
  }
}

void add_clipped(Mesh& mesh, const std::array<MeshVertex, 3>& corners, const std::array<double, 3>& field,
                 std::uint32_t surface) {
  std::array<MeshVertex, 4> kept;
  std::size_t count = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    if (field[i] >= 0.0) kept[count++] = corners[i];
    if ((field[i] >= 0.0) != (field[j] >= 0.0)) {
      const double t = field[i] / (field[i] - field[j]);
      const auto f = static_cast<float>(t);
      kept[count++] = {corners[i].position + t * (corners[j].position - corners[i].position),
                       corners[i].s + f * (corners[j].s - corners[i].s),
                       corners[i].u + f * (corners[j].u - corners[i].u)};
    }
  }
  if (count < 3) return;
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (std::size_t i = 0; i < count; ++i) mesh.vertices.push_back(kept[i]);
  mesh.triangles.push_back({first, first + 1, first + 2, surface});
  if (count == 4) mesh.triangles.push_back({first, first + 2, first + 3, surface});
}

}  // namespace adit::tunnel_simulator
