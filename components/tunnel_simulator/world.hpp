// The world as triangles: swept volumes cut into chunks of at most 20 m whose meshes are made on demand, each a
// function of the description alone, so that any order and any number of threads make the same world.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Geometry>

#include "components/tunnel_simulator/mesh.hpp"
#include "components/tunnel_simulator/world_description.hpp"

namespace adit::tunnel_simulator {

struct Chunk {
  std::size_t volume = 0;
  double begin = 0.0, end = 0.0;  // stations
  Eigen::AlignedBox3d bounds;
};

class World {
 public:
  explicit World(WorldDescription description);
  // A world that is one given mesh (an imported map): no volumes, everything counts as inside.
  World(WorldDescription description, Mesh imported);

  const WorldDescription& description() const { return description_; }
  const std::vector<Chunk>& chunks() const { return chunks_; }
  // Vertex positions are relative to chunk.bounds.center(). Thread-safe.
  Mesh build_mesh(std::size_t chunk) const;

  // Signed "distance" to the inside of the union (negative inside; exact only near the walls) [m]. With `covered`, only
  // volumes with a roof count. An imported world is inside everywhere.
  double field(const Eigen::Vector3d& point, bool covered = false) const;
  // Distance along the tunnel to the nearest portal: negative outside, +inf when the system has no portal. `point` may
  // be in any volume.
  double depth_from_portal(const Eigen::Vector3d& point) const;
  // Index of a volume by name, or volumes().size().
  std::size_t find(const std::string& name) const;

 private:
  double volume_field(std::size_t volume, const Eigen::Vector3d& point) const;
  void add_walls(Mesh& mesh, const Chunk& chunk, const std::vector<std::size_t>& neighbours) const;
  void add_cap(Mesh& mesh, const Chunk& chunk, double station, const std::vector<std::size_t>& neighbours) const;
  double neighbour_field(const std::vector<std::size_t>& neighbours, const Eigen::Vector3d& point) const;

  WorldDescription description_;
  std::vector<Chunk> chunks_;
  std::vector<Eigen::AlignedBox3d> volume_bounds_;
  Mesh imported_;
  bool is_imported_ = false;
};

}  // namespace adit::tunnel_simulator
