#include "components/tunnel_simulator/ray_caster.hpp"

#include <embree3/rtcore.h>

#include <algorithm>
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

Facet facet_of(const Mesh& mesh, const MeshTriangle& t) {
  const MeshVertex& a = mesh.vertices[t.a];
  const MeshVertex& b = mesh.vertices[t.b];
  const MeshVertex& c = mesh.vertices[t.c];
  Eigen::Vector3d n = (b.position - a.position).cross(c.position - a.position);
  n = n.squaredNorm() > 0.0 ? Eigen::Vector3d(n.normalized()) : Eigen::Vector3d::UnitZ();  // no ray hits an area of 0
  return {n.x(), n.y(), n.z(), n.dot(a.position), a.s, b.s - a.s, c.s - a.s, a.u, b.u - a.u, c.u - a.u, t.surface};
}

std::array<float, 12> columns(const Eigen::Matrix3d& r, const Eigen::Vector3d& t) {
  std::array<float, 12> out{};
  for (int c = 0; c < 3; ++c) {
    for (int i = 0; i < 3; ++i) out[static_cast<std::size_t>(3 * c + i)] = static_cast<float>(r(i, c));
  }
  for (int i = 0; i < 3; ++i) out[static_cast<std::size_t>(9 + i)] = static_cast<float>(t[i]);
  return out;
}

}  // namespace

struct RayCaster::EmbreeSolid : Solid {
  RTCScene scene = nullptr;
  mutable std::mutex baking;

  EmbreeSolid(RTCDevice device, Mesh mesh) {
    surfaces = std::move(mesh.surfaces);
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
  ~EmbreeSolid() { rtcReleaseScene(scene); }
  EmbreeSolid(const EmbreeSolid&) = delete;
  EmbreeSolid& operator=(const EmbreeSolid&) = delete;
};

struct RayCaster::Impl {
  const World& world;
  Config config;
  RTCDevice device;
  RTCScene top = nullptr;
  Eigen::Vector3d origin = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  std::vector<std::shared_ptr<EmbreeSolid>> cache;  // by chunk index, null when far
  std::vector<std::shared_ptr<EmbreeSolid>> movers;

  // No limit for Embree's own threads: with TBB it would hold for the whole process. Builds run in an arena instead.
  Impl(const World& w, const Config& c) : world(w), config(c), device(rtcNewDevice("set_affinity=0")) {}
  ~Impl() {
    if (top != nullptr) rtcReleaseScene(top);
    cache.clear();
    movers.clear();
    rtcReleaseDevice(device);
  }

  void attach(const EmbreeSolid& solid, unsigned id, unsigned steps) {
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
  with_threads(config.threads, [&] {
    for (Mesh& mesh : movers) impl_->movers.push_back(std::make_shared<EmbreeSolid>(impl_->device, std::move(mesh)));
  });
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
    auto solid = std::make_shared<EmbreeSolid>(d.device, d.world.build_mesh(i));
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
  slots_.clear();
  for (std::size_t i = 0; i < chunks.size(); ++i) {
    if (!d.cache[i] || chunks[i].bounds.exteriorDistance(rounded) > d.config.radius) continue;
    if (d.cache[i]->facets.empty()) continue;
    d.attach(*d.cache[i], static_cast<unsigned>(slots_.size()), 1);
    slots_.push_back(d.cache[i].get());
  }
  static_slots_ = slots_.size();
  for (const auto& mover : d.movers) {
    d.attach(*mover, static_cast<unsigned>(slots_.size()), 2);
    slots_.push_back(mover.get());
  }
  with_threads(d.config.threads, [&] { rtcCommitScene(d.top); });
}

void RayCaster::move(std::span<const std::array<Pose, 2>> poses) {
  Impl& d = *impl_;
  for (std::size_t i = 0; i < std::min(poses.size(), d.movers.size()); ++i) {
    RTCGeometry instance = rtcGetGeometry(d.top, static_cast<unsigned>(static_slots_ + i));
    for (unsigned step = 0; step < 2; ++step) {
      const Pose& pose = poses[i][step];
      const auto transform = columns(pose.linear(), pose.translation() - d.origin);
      rtcSetGeometryTransform(instance, step, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, transform.data());
    }
    d.movers[i]->turn = poses[i][0].linear().cast<float>();
    rtcCommitGeometry(instance);
  }
  if (!d.movers.empty()) with_threads(d.config.threads, [&] { rtcCommitScene(d.top); });
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

void RayCaster::bake(const Solid& solid) const {
  const auto& lock_of = static_cast<const EmbreeSolid&>(solid);
  const std::lock_guard lock(lock_of.baking);
  if (solid.baked.load(std::memory_order_relaxed)) return;
  solid.texture = LiningTexture(impl_->world.description(), impl_->world.chunks()[solid.chunk], impl_->config.thermal);
  solid.baked.store(true, std::memory_order_release);
}

void RayCaster::surfaces(const RayPacket& packet, HitPacket& hits) const {
  hits.nx = packet.nx;
  hits.ny = packet.ny;
  hits.nz = packet.nz;
  for (std::size_t lane = 0; lane < kPacket; ++lane) {
    hits.texture[lane] = nullptr;
    hits.key[lane] = 0;
    hits.s[lane] = hits.u[lane] = hits.ax[lane] = hits.ay[lane] = hits.temperature[lane] = 0.0F;
    if (!packet.hit(lane)) continue;
    const Solid& solid = *slots_[packet.object[lane]];
    const Facet& f = solid.facets[packet.triangle[lane]];
    const Surface& surface = solid.surfaces[f.surface];
    hits.temperature[lane] = surface.temperature;
    hits.emissivity[lane] = properties(surface.material).emissivity;
    if (surface.lining) {
      const float v = packet.u[lane], w = packet.v[lane];
      hits.s[lane] = f.s + v * f.s_v + w * f.s_w;
      hits.u[lane] = f.u + v * f.u_v + w * f.u_w;
      hits.ax[lane] = solid.axis.x();
      hits.ay[lane] = solid.axis.y();
      if (!solid.baked.load(std::memory_order_acquire)) bake(solid);
      hits.texture[lane] = &solid.texture;
      hits.key[lane] = 1U + static_cast<std::uint32_t>(surface.material);
    } else {
      hits.key[lane] = 1000U + packet.object[lane] * 65536U + f.surface;
      if (is_mover(packet, lane)) {
        const Eigen::Vector3f n = solid.turn * Eigen::Vector3f(packet.nx[lane], packet.ny[lane], packet.nz[lane]);
        hits.nx[lane] = n.x();
        hits.ny[lane] = n.y();
        hits.nz[lane] = n.z();
      }
    }
  }
}

std::size_t RayCaster::triangle_count() const {
  std::size_t sum = 0;
  for (const Solid* s : slots_) sum += s->facets.size();
  return sum;
}

}  // namespace adit::tunnel_simulator
