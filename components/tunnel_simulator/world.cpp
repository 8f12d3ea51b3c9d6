#include "components/tunnel_simulator/world.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "components/tunnel_simulator/equipment.hpp"
#include "components/tunnel_simulator/noise.hpp"
#include "components/tunnel_simulator/random.hpp"

namespace adit::tunnel_simulator {
namespace {

constexpr double kChunk = 20.0;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

double smoothstep(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

Eigen::AlignedBox3d sweep_bounds(const VolumeDescription& v, double begin, double end) {
  Eigen::AlignedBox3d box;
  for (double s = begin;; s = std::min(end, s + 5.0)) {
    for (double l : {v.profile.min().x(), v.profile.max().x()}) {
      for (double h : {v.profile.min().y(), v.profile.max().y()}) box.extend(v.line.point(s, l, h));
    }
    if (s >= end) break;
  }
  const double margin = 0.2 + 4.0 * v.lining.roughness;
  return {box.min().array() - margin, box.max().array() + margin};
}

}  // namespace

World::World(WorldDescription description) : description_(std::move(description)) {
  for (std::size_t i = 0; i < description_.volumes.size(); ++i) {
    const VolumeDescription& v = description_.volumes[i];
    const int count = std::max(1, static_cast<int>(std::ceil(v.line.length() / kChunk - 1e-9)));
    Eigen::AlignedBox3d bounds;
    for (int k = 0; k < count; ++k) {
      const double begin = v.line.length() * k / count;
      const double end = v.line.length() * (k + 1) / count;
      chunks_.push_back({i, begin, end, sweep_bounds(v, begin, end)});
      bounds.extend(chunks_.back().bounds);
    }
    volume_bounds_.push_back(bounds);
  }
}

World::World(WorldDescription description, Mesh imported)
    : description_(std::move(description)), imported_(std::move(imported)), is_imported_(true) {
  Chunk chunk;
  for (const MeshVertex& v : imported_.vertices) chunk.bounds.extend(v.position);
  chunks_.push_back(chunk);
}

std::size_t World::find(const std::string& name) const {
  const auto& v = description_.volumes;
  return static_cast<std::size_t>(
      std::find_if(v.begin(), v.end(), [&](const VolumeDescription& d) { return d.name == name; }) - v.begin());
}

double World::volume_field(std::size_t volume, const Eigen::Vector3d& point) const {
  const VolumeDescription& v = description_.volumes[volume];
  const LineCoordinates c = v.line.project(point);
  return std::max({v.profile.distance(c.l, c.h), -c.s, c.s - v.line.length()});
}

double World::neighbour_field(const std::vector<std::size_t>& neighbours, const Eigen::Vector3d& point) const {
  double least = kInfinity;
  for (std::size_t i : neighbours) {
    const double outside = volume_bounds_[i].exteriorDistance(point);
    least = std::min(least, outside > 1.0 ? outside : volume_field(i, point));
  }
  return least;
}

double World::field(const Eigen::Vector3d& point, bool covered) const {
  if (is_imported_) return -1.0;
  double least = kInfinity;
  for (std::size_t i = 0; i < description_.volumes.size(); ++i) {
    if (covered && description_.volumes[i].kind == VolumeKind::open) continue;
    const double outside = volume_bounds_[i].exteriorDistance(point);
    least = std::min(least, outside > 0.0 ? std::max(outside, 0.01) : volume_field(i, point));
  }
  return least;
}

double World::depth_from_portal(const Eigen::Vector3d& point) const {
  const bool open_air = std::any_of(description_.volumes.begin(), description_.volumes.end(),
                                    [](const auto& v) { return v.kind == VolumeKind::open; });
  if (!open_air) return kInfinity;
  double nearest = kInfinity;
  for (const VolumeDescription& v : description_.volumes) {
    if (!v.portal_begin && !v.portal_end) continue;
    const LineCoordinates c = v.line.project(point);
    const bool beside = std::abs(c.l) > 3.0 * v.profile.width();
    if (v.portal_begin && !beside) nearest = std::min(nearest, c.s);
    if (v.portal_end && !beside) nearest = std::min(nearest, v.line.length() - c.s);
  }
  if (field(point, true) > 0.0) return -std::max(0.1, std::abs(std::min(nearest, 1e3)));
  return std::max(0.0, nearest);
}

Mesh World::build_mesh(std::size_t index) const {
  const Chunk& chunk = chunks_[index];
  if (is_imported_) {
    Mesh mesh = imported_;
    const Eigen::Vector3d centre = chunk.bounds.center();
    for (MeshVertex& v : mesh.vertices) v.position -= centre;
    return mesh;
  }
  const VolumeDescription& volume = description_.volumes[chunk.volume];
  std::vector<std::size_t> neighbours;
  for (std::size_t i = 0; i < description_.volumes.size(); ++i) {
    if (i != chunk.volume && chunk.bounds.intersects(volume_bounds_[i])) neighbours.push_back(i);
  }
  Mesh mesh;
  add_walls(mesh, chunk, neighbours);
  if (volume.cap_begin && chunk.begin <= 0.0) add_cap(mesh, chunk, 0.0, neighbours);
  if (volume.cap_end && chunk.end >= volume.line.length()) add_cap(mesh, chunk, volume.line.length(), neighbours);
  add_equipment(mesh, description_, volume, chunk.begin, chunk.end,
                [&](const Eigen::Vector3d& p) { return neighbour_field(neighbours, p); });
  const Eigen::Vector3d centre = chunk.bounds.center();
  for (MeshVertex& v : mesh.vertices) v.position -= centre;
  return mesh;
}

void World::add_walls(Mesh& mesh, const Chunk& chunk, const std::vector<std::size_t>& neighbours) const {
  const VolumeDescription& v = description_.volumes[chunk.volume];
  const double roughness = v.lining.roughness;
  const bool fine = roughness > 0.0 || !neighbours.empty();
  const double open_factor = v.kind == VolumeKind::open ? 2.5 : 1.0;
  const bool curved = std::abs(v.line.at(chunk.begin).curvature) + std::abs(v.line.at(chunk.end).curvature) +
                          std::abs(v.line.at(0.5 * (chunk.begin + chunk.end)).curvature) >
                      1e-9;
  const double step = fine ? description_.mesh_step * open_factor : (curved ? 1.0 : 5.0);
  const int rows = std::max(1, static_cast<int>(std::ceil((chunk.end - chunk.begin) / step - 1e-9)));
  const std::vector<ProfileVertex> profile = v.profile.sampled(fine ? step : 100.0);
  const std::size_t columns = profile.size();

  std::vector<std::uint32_t> surface_of(columns, 0);
  std::vector<std::pair<Material, std::uint32_t>> known;
  for (std::size_t j = 0; j + 1 < columns; ++j) {
    const Material material = profile[j].edge.material;
    auto it = std::find_if(known.begin(), known.end(), [&](const auto& k) { return k.first == material; });
    if (it == known.end()) {
      Surface surface{material, true, 0.0F, 1.0F};
      if (v.kind == VolumeKind::open) {
        surface.temperature = static_cast<float>(description_.temperatures.ground - description_.temperatures.wall);
      } else if (description_.texture >= 2 && material != v.lining.material) {
        surface.temperature = material == Material::asphalt ? 0.4F : -0.2F;
      }
      known.emplace_back(material, mesh.add_surface(surface));
      it = std::prev(known.end());
    }
    surface_of[j] = it->second;
  }

  const auto noise_seed = static_cast<std::uint32_t>(mix(description_.seed, 1000 + chunk.volume));
  const double wavelength = 2.0 * std::max(v.lining.correlation, description_.mesh_step);
  std::vector<MeshVertex> grid(static_cast<std::size_t>(rows + 1) * columns);
  std::vector<double> field(grid.size(), kInfinity);
  for (int i = 0; i <= rows; ++i) {
    const double s = chunk.begin + (chunk.end - chunk.begin) * i / rows;
    for (std::size_t j = 0; j < columns; ++j) {
      const std::size_t k = static_cast<std::size_t>(i) * columns + j;
      const ProfileVertex& p = profile[j];
      Eigen::Vector3d position = v.line.point(s, p.position.x(), p.position.y());
      if (!neighbours.empty()) field[k] = neighbour_field(neighbours, position);
      if (roughness > 0.0) {
        const std::size_t before = j == 0 ? columns - 2 : j - 1;
        const double factor = std::min(p.edge.roughness, profile[before].edge.roughness);
        const double u = j + 1 == columns ? 0.0 : p.u;
        const double d =
            roughness * factor * smoothstep(field[k] / 0.6) *
            fractal_noise(static_cast<float>(s / wavelength), static_cast<float>(u / wavelength), 3, 0.55F, noise_seed);
        position = v.line.point(s, p.position.x() + d * p.normal.x(), p.position.y() + d * p.normal.y());
      }
      grid[k] = {position, static_cast<float>(s - chunk.begin), static_cast<float>(p.u)};
    }
  }

  const auto base = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), grid.begin(), grid.end());
  for (int i = 0; i < rows; ++i) {
    for (std::size_t j = 0; j + 1 < columns; ++j) {
      if (profile[j].edge.open) continue;
      const std::size_t a = static_cast<std::size_t>(i) * columns + j;
      const std::array<std::size_t, 4> q{a, a + columns, a + columns + 1, a + 1};
      for (const auto& t :
           {std::array<std::size_t, 3>{q[0], q[1], q[2]}, std::array<std::size_t, 3>{q[0], q[2], q[3]}}) {
        const std::array<double, 3> f{field[t[0]], field[t[1]], field[t[2]]};
        if (f[0] >= 0.0 && f[1] >= 0.0 && f[2] >= 0.0) {
          mesh.triangles.push_back({base + static_cast<std::uint32_t>(t[0]), base + static_cast<std::uint32_t>(t[1]),
                                    base + static_cast<std::uint32_t>(t[2]), surface_of[j]});
        } else if (f[0] >= 0.0 || f[1] >= 0.0 || f[2] >= 0.0) {
          add_clipped(mesh, {grid[t[0]], grid[t[1]], grid[t[2]]}, f, surface_of[j]);
        }
      }
    }
  }
}

void World::add_cap(Mesh& mesh, const Chunk& chunk, double station, const std::vector<std::size_t>& neighbours) const {
  const VolumeDescription& v = description_.volumes[chunk.volume];
  Surface surface{v.lining.material, false, 0.0F, 1.0F};
  if (v.kind == VolumeKind::open) {
    surface.material = Material::concrete;
    surface.temperature = 0.5F * static_cast<float>(description_.temperatures.ground - description_.temperatures.wall);
  }
  const std::uint32_t index = mesh.add_surface(surface);
  const double step = v.kind == VolumeKind::open ? 0.4 : 0.2;
  const Eigen::Vector2d low = v.profile.min();
  const Eigen::Vector2d size = v.profile.max() - low;
  const int nl = static_cast<int>(std::ceil(size.x() / step));
  const int nh = static_cast<int>(std::ceil(size.y() / step));
  std::vector<MeshVertex> grid;
  std::vector<double> field;
  for (int i = 0; i <= nh; ++i) {
    for (int j = 0; j <= nl; ++j) {
      const double l = low.x() + size.x() * j / nl;
      const double h = low.y() + size.y() * i / nh;
      grid.push_back({v.line.point(station, l, h)});
      field.push_back(std::min(1e-9 - v.profile.distance(l, h), neighbour_field(neighbours, grid.back().position)));
    }
  }
  const auto at = [&](int i, int j) { return static_cast<std::size_t>(i * (nl + 1) + j); };
  for (int i = 0; i < nh; ++i) {
    for (int j = 0; j < nl; ++j) {
      const std::array<std::size_t, 4> q{at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)};
      add_clipped(mesh, {grid[q[0]], grid[q[1]], grid[q[2]]}, {field[q[0]], field[q[1]], field[q[2]]}, index);
      add_clipped(mesh, {grid[q[0]], grid[q[2]], grid[q[3]]}, {field[q[0]], field[q[2]], field[q[3]]}, index);
    }
  }
}

}  // namespace adit::tunnel_simulator
