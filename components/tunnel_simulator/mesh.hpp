// Triangle meshes of one chunk of the world and the primitives equipment is made of.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "components/tunnel_simulator/material.hpp"

namespace adit::tunnel_simulator {

// What a triangle looks like to the sensors.
struct Surface {
  Material material = Material::concrete;
  bool lining = false;        // temperature and reflectivity come from the chunk's lining texture at (s, u)
  float temperature = 0.0F;   // kelvin above the undisturbed wall
  float reflectivity = 1.0F;  // factor on the material's
};

// Positions are relative to the chunk's origin. (s, u) are lining coordinates relative to the chunk's begin; they mean
// something only to lining surfaces.
struct MeshVertex {
  Eigen::Vector3d position;
  float s = 0.0F, u = 0.0F;
};

struct MeshTriangle {
  std::uint32_t a, b, c;
  std::uint32_t surface;
};

struct Mesh {
  std::vector<MeshVertex> vertices;
  std::vector<MeshTriangle> triangles;
  std::vector<Surface> surfaces;

  std::uint32_t add_surface(const Surface& surface);
  void add_quad(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c, const Eigen::Vector3d& d,
                std::uint32_t surface);
  // Eight corners: bit 0 = first axis, bit 1 = second, bit 2 = third.
  void add_hexahedron(const std::array<Eigen::Vector3d, 8>& corners, std::uint32_t surface);
  void add_box(const Eigen::Vector3d& centre, const Eigen::Matrix3d& axes, const Eigen::Vector3d& size,
               std::uint32_t surface);
  // Closed cylinder or, with a zero end radius, cone.
  void add_cylinder(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius_from, double radius_to,
                    int sides, std::uint32_t surface);
};

// Keeps the part of triangle (a, b, c) where the field, given at its corners, is >= 0 and appends it to `mesh`; new
// vertices lie where the linear interpolation of the field is 0.
void add_clipped(Mesh& mesh, const std::array<MeshVertex, 3>& corners, const std::array<double, 3>& field,
                 std::uint32_t surface);

}  // namespace adit::tunnel_simulator
