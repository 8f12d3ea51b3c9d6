// The world in Embree: the chunks around the vehicle as instances of small scenes in chunk coordinates (so float
// precision does not depend on where in the world the vehicle is), and the moving objects.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "components/geometry/se3.hpp"
#include "components/tunnel_simulator/lining_texture.hpp"
#include "components/tunnel_simulator/world.hpp"

namespace adit::tunnel_simulator {

constexpr std::size_t kPacket = 16;
constexpr std::uint32_t kNoHit = 0xffffffffU;

// Sixteen rays and their hits: the memory layout of Embree's RTCRayHit16, so nothing is copied. Origins are relative to
// RayCaster::origin(), directions unit vectors in the world frame, time in [0, 1] of the interval given to move().
struct alignas(64) RayPacket {
  using F = std::array<float, kPacket>;
  using U = std::array<std::uint32_t, kPacket>;
  F ox, oy, oz, near, dx, dy, dz, time, far;
  U mask, id, flags;
  F nx, ny, nz, u, v;  // normal in the object's frame, not normalized: see SurfaceHit
  U triangle, geometry, object;
  bool hit(std::size_t lane) const { return geometry[lane] != kNoHit; }
};

// What a ray met. `texture` is null off the lining.
struct SurfaceHit {
  const Surface* surface = nullptr;
  const LiningTexture* texture = nullptr;
  float s = 0.0F, u = 0.0F;
  std::uint32_t key = 0;                              // equal for equal surfaces of one object
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();  // unit, world; either side
  Eigen::Vector3f axis = Eigen::Vector3f::UnitX();    // of the tunnel, world
};

class RayCaster {
 public:
  struct Config {
    double radius = 200.0;  // chunks nearer than this are present [m]
    bool thermal = true;    // bake temperature textures
    int threads = 1;        // for building chunks
  };
  // `world` outlives the caster. Moving objects share one mesh list for the whole run.
  RayCaster(const World& world, const Config& config, std::vector<Mesh> movers = {});
  ~RayCaster();
  RayCaster(const RayCaster&) = delete;
  RayCaster& operator=(const RayCaster&) = delete;

  // Makes the chunks around a place present. What is present depends on the place alone.
  void look_from(const Eigen::Vector3d& place);
  // Poses of the moving objects (world <- object) at ray time 0 and 1; call before casting, after look_from.
  void move(std::span<const std::array<Pose, 2>> poses);
  const Eigen::Vector3d& origin() const;
  const Temperatures& temperatures() const;

  // Thread-safe. All lanes are cast; fill unused ones with far = -1.
  void cast(RayPacket& packet) const;
  // Has the memory fetched that exact_range() and surface() will need, all lanes at once.
  void prefetch(const RayPacket& packet) const;
  // Range along a double-precision ray (world coordinates) to the plane of the triangle a lane hit: removes the float
  // rounding of the traversal. Moving objects: the float range.
  double exact_range(const RayPacket& packet, std::size_t lane, const Eigen::Vector3d& from,
                     const Eigen::Vector3d& direction) const;
  SurfaceHit surface(const RayPacket& packet, std::size_t lane) const;
  bool is_mover(const RayPacket& packet, std::size_t lane) const;
  std::size_t triangle_count() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace adit::tunnel_simulator
