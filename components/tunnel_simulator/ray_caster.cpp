#include "components/tunnel_simulator/ray_caster.hpp"

#include <embree3/rtcore.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <mutex>

#include "components/tunnel_simulator/parallel.hpp"

namespace adit::tunnel_simulator {
namespace {

static_assert(sizeof(RayPacket) == sizeof(RTCRayHit16) && alignof(RayPacket) == alignof(RTCRayHit16));
static_assert(offsetof(RayPacket, far) == offsetof(RTCRayHit16, ray.tfar));
static_assert(offsetof(RayPacket, nx) == offsetof(RTCRayHit16, hit.Ng_x));
static_assert(offsetof(RayPacket, object) == offsetof(RTCRayHit16, hit.instID));

constexpr double kGrid = 8.0;  // places are rounded to this, so that small motions change nothing

// All that shading needs of a triangle, in one cache line.
struct alignas(64) Facet {
  double nx, ny, nz, offset;       // unit normal n and n . p of its plane, object frame
  float s, s_v, s_w, u, u_v, u_w;  // lining coordinates are affine in the hit's barycentric (v, w)
  std::uint32_t surface, unused = 0;
};
static_assert(sizeof(Facet) == 64);

Facet facet_of(const Mesh& mesh, const MeshTriangle& t) {
  const MeshVertex& a = mesh.vertices[t.a];
  const MeshVertex& b = mesh.vertices[t.b];
  const MeshVertex& c = mesh.vertices[t.c];
  Eigen::Vector3d n = (b.position - a.position).cross(c.position - a.position);
  n = n.squaredNorm() > 0.0 ? Eigen::Vector3d(n.normalized()) : Eigen::Vector3d::UnitZ();  // no ray hits an area of 0
  return {n.x(), n.y(), n.z(), n.dot(a.position), a.s, b.s - a.s, c.s - a.s, a.u, b.u - a.u, c.u - a.u, t.surface};
}

// A mesh in Embree with what shading needs.
struct Solid {
  std::vector<Facet> facets;
  std::vector<Surface> surfaces;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3f axis = Eigen::Vector3f::UnitX();
  Eigen::Matrix3f turn = Eigen::Matrix3f::Identity();  // world <- object
  std::size_t chunk = 0;
  RTCScene scene = nullptr;
  mutable std::mutex baking;
  mutable std::atomic<bool> baked{false};
  mutable LiningTexture texture;

  Solid(RTCDevice device, Mesh mesh) : surfaces(std::move(mesh.surfaces)) {
    facets.reserve(mesh.triangles.size());
    for (const MeshTriangle& t : mesh.triangles) facets.push_back(facet_of(mesh, t));
    scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                                 3 * sizeof(float), mesh.vertices.size()));
    auto* indices = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t), mesh.triangles.size()));
    for (const MeshVertex& v : mesh.vertices) {
      for (int i = 0; i < 3; ++i) *vertices++ = static_cast<float>(v.position[i]);
    }
    for (const MeshTriangle& t : mesh.triangles) {
      *indices++ = t.a;
      *indices++ = t.b;
      *indices++ = t.c;
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene);
  }
  // Of the lining; baked when it is first seen.
  const LiningTexture& lining(const World& world, bool thermal) const {
    if (!baked.load(std::memory_order_acquire)) {
      const std::lock_guard lock(baking);
      if (!baked.load(std::memory_order_relaxed)) {
        texture = LiningTexture(world.description(), world.chunks()[chunk], thermal);
        baked.store(true, std::memory_order_release);
      }
    }
    return texture;
  }
  ~Solid() { rtcReleaseScene(scene); }
  Solid(const Solid&) = delete;
  Solid& operator=(const Solid&) = delete;
};

std::array<float, 12> columns(const Eigen::Matrix3d& r, const Eigen::Vector3d& t) {
  std::array<float, 12> out{};
  for (int c = 0; c < 3; ++c) {
    for (int i = 0; i < 3; ++i) out[static_cast<std::size_t>(3 * c + i)] = static_cast<float>(r(i, c));
  }
  for (int i = 0; i < 3; ++i) out[static_cast<std::size_t>(9 + i)] = static_cast<float>(t[i]);
  return out;
}

}  // namespace

struct RayCaster::Impl {
  const World& world;
  Config config;
  RTCDevice device;
  RTCScene top = nullptr;
  Eigen::Vector3d origin = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  std::vector<std::shared_ptr<Solid>> cache;  // by chunk index, null when far
  std::vector<std::shared_ptr<Solid>> movers;
  std::vector<const Solid*> slots;  // by instance id; movers last
  std::size_t static_slots = 0;

  Impl(const World& w, const Config& c) : world(w), config(c), device(rtcNewDevice("threads=1,set_affinity=0")) {}
  ~Impl() {
    if (top != nullptr) rtcReleaseScene(top);
    cache.clear();
    movers.clear();
    rtcReleaseDevice(device);
  }

  void attach(const Solid& solid, unsigned id, unsigned steps) {
    RTCGeometry instance = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(instance, solid.scene);
    rtcSetGeometryTimeStepCount(instance, steps);
    const auto transform = columns(Eigen::Matrix3d::Identity(), solid.centre - origin);
    for (unsigned i = 0; i < steps; ++i) {
      rtcSetGeometryTransform(instance, i, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, transform.data());
    }
    rtcCommitGeometry(instance);
    rtcAttachGeometryByID(top, instance, id);
    rtcReleaseGeometry(instance);
  }
};

RayCaster::RayCaster(const World& world, const Config& config, std::vector<Mesh> movers)
    : impl_(std::make_unique<Impl>(world, config)) {
  impl_->cache.resize(world.chunks().size());
  for (Mesh& mesh : movers) impl_->movers.push_back(std::make_shared<Solid>(impl_->device, std::move(mesh)));
}

RayCaster::~RayCaster() = default;

const Eigen::Vector3d& RayCaster::origin() const {
  return impl_->origin;
}
const Temperatures& RayCaster::temperatures() const {
  return impl_->world.description().temperatures;
}

void RayCaster::look_from(const Eigen::Vector3d& place) {
  Impl& d = *impl_;
  const Eigen::Vector3d rounded = (place / kGrid).array().round() * kGrid;
  if (rounded == d.origin) return;
  d.origin = rounded;
  const std::vector<Chunk>& chunks = d.world.chunks();
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < chunks.size(); ++i) {
    const double distance = chunks[i].bounds.exteriorDistance(rounded);
    if (distance > d.config.radius + 2.0 * kGrid) d.cache[i].reset();
    if (distance <= d.config.radius && !d.cache[i]) missing.push_back(i);
  }
  parallel_for(d.config.threads, missing.size(), [&](std::size_t k) {
    const std::size_t i = missing[k];
    auto solid = std::make_shared<Solid>(d.device, d.world.build_mesh(i));
    solid->centre = chunks[i].bounds.center();
    solid->chunk = i;
    if (!d.world.description().volumes.empty()) {
      const LinePoint p =
          d.world.description().volumes[chunks[i].volume].line.at(0.5 * (chunks[i].begin + chunks[i].end));
      solid->axis = Eigen::Vector3d(std::cos(p.heading), std::sin(p.heading), 0.0).cast<float>();
    }
    d.cache[i] = std::move(solid);
  });
  if (d.top != nullptr) rtcReleaseScene(d.top);
  d.top = rtcNewScene(d.device);
  rtcSetSceneFlags(d.top, RTC_SCENE_FLAG_ROBUST);
  d.slots.clear();
  for (std::size_t i = 0; i < chunks.size(); ++i) {
    if (!d.cache[i] || chunks[i].bounds.exteriorDistance(rounded) > d.config.radius) continue;
    if (d.cache[i]->facets.empty()) continue;
    d.attach(*d.cache[i], static_cast<unsigned>(d.slots.size()), 1);
    d.slots.push_back(d.cache[i].get());
  }
  d.static_slots = d.slots.size();
  for (const auto& mover : d.movers) {
    d.attach(*mover, static_cast<unsigned>(d.slots.size()), 2);
    d.slots.push_back(mover.get());
  }
  rtcCommitScene(d.top);
}

void RayCaster::move(std::span<const std::array<Pose, 2>> poses) {
  Impl& d = *impl_;
  for (std::size_t i = 0; i < std::min(poses.size(), d.movers.size()); ++i) {
    RTCGeometry instance = rtcGetGeometry(d.top, static_cast<unsigned>(d.static_slots + i));
    for (unsigned step = 0; step < 2; ++step) {
      const Pose& pose = poses[i][step];
      const auto transform = columns(pose.linear(), pose.translation() - d.origin);
      rtcSetGeometryTransform(instance, step, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, transform.data());
    }
    d.movers[i]->turn = poses[i][0].linear().cast<float>();
    rtcCommitGeometry(instance);
  }
  if (!d.movers.empty()) rtcCommitScene(d.top);
}

void RayCaster::cast(RayPacket& packet) const {
  static constexpr std::array<int, kPacket> kAll{-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1};
  alignas(64) std::array<int, kPacket> valid = kAll;
  packet.near.fill(0.0F);
  packet.mask.fill(0xffffffffU);
  packet.flags.fill(0U);
  packet.geometry.fill(kNoHit);
  packet.object.fill(kNoHit);
  for (std::size_t i = 0; i < kPacket; ++i) valid[i] = packet.far[i] > 0.0F ? -1 : 0;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect16(valid.data(), impl_->top, &context, reinterpret_cast<RTCRayHit16*>(&packet));
}

void RayCaster::prefetch(const RayPacket& packet) const {
  for (std::size_t lane = 0; lane < kPacket; ++lane) {
    if (packet.hit(lane)) __builtin_prefetch(&impl_->slots[packet.object[lane]]->facets[packet.triangle[lane]]);
  }
}

double RayCaster::exact_range(const RayPacket& packet, std::size_t lane, const Eigen::Vector3d& from,
                              const Eigen::Vector3d& direction) const {
  if (is_mover(packet, lane)) return packet.far[lane];
  const Solid& solid = *impl_->slots[packet.object[lane]];
  const Facet& f = solid.facets[packet.triangle[lane]];
  const double along = f.nx * direction.x() + f.ny * direction.y() + f.nz * direction.z();
  const double above = f.nx * (from.x() - solid.centre.x()) + f.ny * (from.y() - solid.centre.y()) +
                       f.nz * (from.z() - solid.centre.z());
  const double range = (f.offset - above) / along;
  // A sliver seen edge-on has no usable plane: keep what the traversal found.
  return std::abs(range - packet.far[lane]) < 0.01 ? range : packet.far[lane];
}

SurfaceHit RayCaster::surface(const RayPacket& packet, std::size_t lane) const {
  const Solid& solid = *impl_->slots[packet.object[lane]];
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
  hit.texture = &solid.lining(impl_->world, impl_->config.thermal);
  return hit;
}

bool RayCaster::is_mover(const RayPacket& packet, std::size_t lane) const {
  return packet.object[lane] >= impl_->static_slots;
}

std::size_t RayCaster::triangle_count() const {
  std::size_t sum = 0;
  for (const Solid* s : impl_->slots) sum += s->facets.size();
  return sum;
}

}  // namespace adit::tunnel_simulator
