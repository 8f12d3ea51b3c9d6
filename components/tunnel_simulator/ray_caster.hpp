// The world in Embree: the chunks around the vehicle as instances of small scenes in chunk coordinates (so float
// precision does not depend on where in the world the vehicle is), and the moving objects.
#pragma once

#include <array>
#include <atomic>
#include <cmath>
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

// All that shading needs of a triangle, in one cache line.
struct alignas(64) Facet {
  double nx, ny, nz, offset;       // unit normal n and n . p of its plane, object frame
  float s, s_v, s_w, u, u_v, u_w;  // lining coordinates are affine in the hit's barycentric (v, w)
  std::uint32_t surface, unused = 0;
};
static_assert(sizeof(Facet) == 64);

// What a thermal camera needs of sixteen hits at once. Lanes without a hit have no surface.
struct HitPacket {
  RayPacket::F s, u;         // lining coordinates
  RayPacket::F nx, ny, nz;   // along the normal, world, of any length
  RayPacket::F ax, ay;       // axis of the tunnel, world (its z is 0)
  RayPacket::F temperature;  // of the surface, texture aside
  RayPacket::F emissivity;
  RayPacket::U key;  // equal for equal surfaces of one object, and for one lining through all its chunks
  std::array<const LiningTexture*, kPacket> texture;
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
  void prefetch(const RayPacket& packet) const {
    for (std::size_t lane = 0; lane < kPacket; ++lane) {
      if (packet.hit(lane)) __builtin_prefetch(slots_[packet.object[lane]]->facets.data() + packet.triangle[lane]);
    }
  }
  // Range along a double-precision ray (world coordinates) to the plane of the triangle a lane hit: removes the float
  // rounding of the traversal. Moving objects: the float range.
  double exact_range(const RayPacket& packet, std::size_t lane, const Eigen::Vector3d& from,
                     const Eigen::Vector3d& direction) const;
  SurfaceHit surface(const RayPacket& packet, std::size_t lane) const;
  // The same for all lanes.
  void surfaces(const RayPacket& packet, HitPacket& hits) const;
  bool is_mover(const RayPacket& packet, std::size_t lane) const;
  std::size_t triangle_count() const;

 private:
  struct Solid {  // a mesh as shading sees it
    std::vector<Facet> facets;
    std::vector<Surface> surfaces;
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    Eigen::Vector3f axis = Eigen::Vector3f::UnitX();
    Eigen::Matrix3f turn = Eigen::Matrix3f::Identity();  // world <- object
    std::size_t chunk = 0;
    mutable std::atomic<bool> baked{false};
    mutable LiningTexture texture;
  };
  struct EmbreeSolid;
  struct Impl;
  // Bakes the solid's texture, once.
  void bake(const Solid& solid) const;

  std::unique_ptr<Impl> impl_;
  std::vector<const Solid*> slots_;  // by instance id; movers last
  std::size_t static_slots_ = 0;
};

inline bool RayCaster::is_mover(const RayPacket& packet, std::size_t lane) const {
  return packet.object[lane] >= static_slots_;
}

inline double RayCaster::exact_range(const RayPacket& packet, std::size_t lane, const Eigen::Vector3d& from,
                                     const Eigen::Vector3d& direction) const {
  if (is_mover(packet, lane)) return packet.far[lane];
  const Solid& solid = *slots_[packet.object[lane]];
  const Facet& f = solid.facets[packet.triangle[lane]];
  const double along = f.nx * direction.x() + f.ny * direction.y() + f.nz * direction.z();
  const double above = f.nx * (from.x() - solid.centre.x()) + f.ny * (from.y() - solid.centre.y()) +
                       f.nz * (from.z() - solid.centre.z());
  const double range = (f.offset - above) / along;
  // A sliver seen edge-on has no usable plane: keep what the traversal found.
  return std::abs(range - packet.far[lane]) < 0.01 ? range : packet.far[lane];
}

inline SurfaceHit RayCaster::surface(const RayPacket& packet, std::size_t lane) const {
  const Solid& solid = *slots_[packet.object[lane]];
  const Facet& f = solid.facets[packet.triangle[lane]];
  SurfaceHit hit;
  hit.surface = &solid.surfaces[f.surface];
  hit.normal = Eigen::Vector3f(static_cast<float>(f.nx), static_cast<float>(f.ny), static_cast<float>(f.nz));
  if (is_mover(packet, lane)) hit.normal = solid.turn * hit.normal;
  hit.axis = solid.axis;
  hit.key = packet.object[lane] * 65536U + f.surface;
  if (!hit.surface->lining) return hit;
  const float v = packet.u[lane];
  const float w = packet.v[lane];
  hit.s = f.s + v * f.s_v + w * f.s_w;
  hit.u = f.u + v * f.u_v + w * f.u_w;
  if (!solid.baked.load(std::memory_order_acquire)) bake(solid);
  hit.texture = &solid.texture;
  return hit;
}

}  // namespace adit::tunnel_simulator
