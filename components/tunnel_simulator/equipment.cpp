#include "components/tunnel_simulator/equipment.hpp"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "components/tunnel_simulator/random.hpp"

namespace adit::tunnel_simulator {
namespace {

// Calls place(s, index) for each station (index + 0.5) * spacing in [begin, end).
template <class Place>
void each(double spacing, double begin, double end, Place place) {
  if (spacing <= 0.0) return;
  for (auto k = static_cast<std::int64_t>(std::ceil(begin / spacing - 0.5));
       (static_cast<double>(k) + 0.5) * spacing < end; ++k) {
    place((static_cast<double>(k) + 0.5) * spacing, static_cast<std::uint64_t>(k + 100000));
  }
}

RandomStream stream(const WorldDescription& world, const VolumeDescription& volume, std::uint64_t purpose) {
  std::uint64_t name = 0;
  for (char c : volume.name) name = mix(name, static_cast<std::uint64_t>(c));
  return {world.seed, mix(purpose, name)};
}

class Installer {
 public:
  Installer(Mesh& mesh, const WorldDescription& world, const VolumeDescription& volume,
            const std::function<double(const Eigen::Vector3d&)>& neighbour_field)
      : mesh_(mesh), world_(world), volume_(volume), neighbour_field_(neighbour_field) {}

  bool free(double s, double l, double h) const { return neighbour_field_(volume_.line.point(s, l, h)) > 0.3; }

  // Kelvin above the wall, if the texture level shows this kind of thing.
  float heat(double kelvin, int from_level = 3) const {
    return world_.texture >= from_level ? static_cast<float>(kelvin) : 0.0F;
  }

  std::uint32_t surface(Material material, float temperature) {
    return mesh_.add_surface({material, false, temperature, 1.0F});
  }

  // A box in tunnel coordinates, `size` along (s, across, up), rolled about the axis by `roll`.
  void box(double s, double l, double h, const Eigen::Vector3d& size, std::uint32_t index, double roll = 0.0) {
    std::array<Eigen::Vector3d, 8> corners;
    for (std::size_t i = 0; i < 8; ++i) {
      const double a = ((i & 2U) != 0U ? 0.5 : -0.5) * size.y();
      const double b = ((i & 4U) != 0U ? 0.5 : -0.5) * size.z();
      corners[i] =
          volume_.line.point(s + ((i & 1U) != 0U ? 0.5 : -0.5) * size.x(), l + a * std::cos(roll) - b * std::sin(roll),
                             h + a * std::sin(roll) + b * std::cos(roll));
    }
    mesh_.add_hexahedron(corners, index);
  }

  // On the lining at arc length u, standing off by half its thickness: size along (s, u, normal).
  void on_wall(double s, double u, const Eigen::Vector3d& size, std::uint32_t index) {
    const Eigen::Vector2d p = volume_.profile.at(u);
    const Eigen::Vector2d tangent = (volume_.profile.at(u + 0.02) - p).normalized();
    const Eigen::Vector2d normal(-tangent.y(), tangent.x());
    const Eigen::Vector2d centre = p + normal * (0.5 * size.z() + 0.03);
    if (!free(s, p.x(), p.y())) return;
    box(s, centre.x(), centre.y(), size, index, std::atan2(tangent.y(), tangent.x()));
  }

  void cylinder(double s0, double s1, double l, double h, double radius, int sides, std::uint32_t index) {
    mesh_.add_cylinder(volume_.line.point(s0, l, h), volume_.line.point(s1, l, h), radius, radius, sides, index);
  }

  // Continuous box from begin to end in pieces of at most 2 m.
  template <class Piece>
  void along(double begin, double end, double l, double h, Piece piece) {
    const int n = std::max(1, static_cast<int>(std::ceil((end - begin) / 2.0)));
    const double step = (end - begin) / n;
    for (int i = 0; i < n; ++i) {
      const double s = begin + (i + 0.5) * step;
      if (free(s - step / 2.0, l, h) && free(s + step / 2.0, l, h)) piece(s, step);
    }
  }

  Eigen::Vector2d wall(double h, double side) const { return volume_.profile.at(volume_.profile.u_at_height(h, side)); }

  Mesh& mesh_;
  const WorldDescription& world_;
  const VolumeDescription& volume_;
  const std::function<double(const Eigen::Vector3d&)>& neighbour_field_;
};

void add_running_equipment(Installer& in, double begin, double end) {
  const Equipment& e = in.volume_.equipment;
  const double top = in.volume_.profile.max().y();
  if (e.tray) {
    const double h = 0.62 * top;
    const double l = in.wall(h, -1.0).x() + 0.3;
    const std::uint32_t tray = in.surface(Material::painted_metal, in.heat(0.8));
    const std::uint32_t cable = in.surface(Material::rubber, in.heat(3.0));
    in.along(begin, end, l, h, [&](double s, double length) {
      in.box(s, l, h, {length, 0.4, 0.05}, tray);
      in.box(s, l + 0.05, h + 0.05, {length, 0.2, 0.05}, cable);
    });
    each(1.5, begin, end, [&](double s, std::uint64_t) {
      if (in.free(s, l, h)) in.box(s, l - 0.1, h - 0.08, {0.05, 0.6, 0.1}, tray);
    });
  }
  if (e.pipe) {
    const double h = 0.75;
    const double l = in.wall(h, 1.0).x() - 0.2;
    const std::uint32_t pipe = in.surface(Material::painted_metal, in.heat(-2.0));
    const std::uint32_t holder = in.surface(Material::painted_metal, in.heat(-0.4));
    in.along(begin, end, l, h,
             [&](double s, double length) { in.cylinder(s - length / 2, s + length / 2, l, h, 0.09, 10, pipe); });
    each(3.0, begin, end, [&](double s, std::uint64_t) {
      if (in.free(s, l, h)) in.box(s, l + 0.08, h - 0.12, {0.06, 0.3, 0.1}, holder);
    });
    each(53.0, begin, end, [&](double s, std::uint64_t) {
      if (!in.free(s, l, h)) return;
      in.cylinder(s - 0.2, s + 0.2, l, h, 0.16, 12, pipe);
      in.box(s, l - 0.15, h + 0.2, {0.3, 0.05, 0.3}, holder);
    });
  }
  if (e.rails) {
    const std::uint32_t steel = in.surface(Material::bare_metal, 0.0F);
    const std::uint32_t sleeper = in.surface(Material::concrete, in.heat(-0.2));
    for (double l : {-0.75, 0.75}) {
      in.along(begin, end, l, 0.2, [&](double s, double length) { in.box(s, l, 0.17, {length, 0.07, 0.15}, steel); });
    }
    each(0.6, begin, end, [&](double s, std::uint64_t) {
      if (in.free(s, 0.0, 0.3)) in.box(s, 0.0, 0.05, {0.26, 2.4, 0.1}, sleeper);
    });
  }
}

void add_single_equipment(Installer& in, double begin, double end) {
  const Equipment& e = in.volume_.equipment;
  const double top = in.volume_.profile.max().y();
  const RandomStream random = stream(in.world_, in.volume_, 11);
  each(e.cabinets, begin, end, [&](double s, std::uint64_t k) {
    const double side = random.uniform(k) < 0.5 ? -1.0 : 1.0;
    const double l = in.wall(1.0, side).x() - side * 0.28;
    if (!in.free(s, l, 1.0)) return;
    const std::uint32_t body = in.surface(Material::painted_metal, in.heat(random.uniform(k + 1000000, 1.0, 6.0)));
    const std::uint32_t warm = in.surface(Material::plastic, in.heat(random.uniform(k + 2000000, 4.0, 10.0)));
    in.box(s, l, 0.97, {0.9, 0.4, 1.6}, body);
    in.box(s, l - side * 0.21, 1.4, {0.4, 0.02, 0.25}, warm);
  });
  each(e.hydrants, begin, end, [&](double s, std::uint64_t) {
    const double l = in.wall(0.8, 1.0).x() - 0.45;
    if (!in.free(s, l, 0.8)) return;
    const std::uint32_t red = in.surface(Material::painted_metal, in.heat(-1.5));
    in.mesh_.add_cylinder(in.volume_.line.point(s, l, 0.1), in.volume_.line.point(s, l, 1.0), 0.12, 0.12, 12, red);
  });
  each(e.fans, begin, end, [&](double s, std::uint64_t k) {
    const std::uint32_t body = in.surface(Material::painted_metal, in.heat(2.0));
    const std::uint32_t hub = in.surface(Material::painted_metal, in.heat(random.uniform(k + 3000000, 4.0, 10.0)));
    for (double l : {-1.2, 1.2}) {
      if (!in.free(s, l, top - 1.2)) continue;
      in.cylinder(s - 1.75, s + 1.75, l, top - 1.25, 0.55, 20, body);
      in.cylinder(s - 1.85, s + 1.85, l, top - 1.25, 0.22, 12, hub);
      in.box(s, l, top - 0.5, {0.3, 0.1, 0.9}, body);
    }
  });
  each(e.rubble, begin, end, [&](double s, std::uint64_t k) {
    const double side = random.uniform(k + 4000000) < 0.5 ? -1.0 : 1.0;
    const double size = random.uniform(k + 5000000, 0.08, 0.35);
    const double l = in.wall(0.3, side).x() - side * random.uniform(k + 6000000, 0.15, 0.7);
    const double at = s + random.uniform(k + 7000000, -0.4, 0.4) * e.rubble;
    if (!in.free(at, l, 0.3)) return;
    const Eigen::Vector3d axis =
        Eigen::Vector3d(random.normal(k + 8000000), random.normal(k + 9000000), random.normal(k + 10000000))
            .normalized();
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(random.uniform(k + 11000000, 0.0, 3.0), axis).toRotationMatrix();
    in.mesh_.add_box(in.volume_.line.point(at, l, 0.12 + 0.3 * size), turn, {size, 0.8 * size, 0.6 * size},
                     in.surface(Material::rock, in.heat(-0.3)));
  });
  if (e.trees) {
    each(4.0, begin, end, [&](double s, std::uint64_t k) {
      const double side = random.uniform(k + 12000000) < 0.5 ? -1.0 : 1.0;
      const double l = side * (0.5 * in.volume_.profile.width() - random.uniform(k + 13000000, 14.0, 24.0));
      const double h = random.uniform(k + 14000000, 4.0, 9.0);
      if (!in.free(s, l, 0.5) || std::abs(l) < 14.0) return;
      const std::uint32_t trunk = in.surface(Material::wood, in.heat(-2.0, 1));
      const std::uint32_t crown = in.surface(Material::vegetation, in.heat(-3.0, 1));
      in.mesh_.add_cylinder(in.volume_.line.point(s, l, -0.2), in.volume_.line.point(s, l, 2.0), 0.18, 0.15, 8, trunk);
      in.mesh_.add_cylinder(in.volume_.line.point(s, l, 1.2), in.volume_.line.point(s, l, h), 1.6, 0.0, 9, crown);
    });
  }
}

}  // namespace

std::vector<Fixture> lamps(const WorldDescription& world, const VolumeDescription& v, double begin, double end) {
  std::vector<Fixture> out;
  const RandomStream random = stream(world, v, 21);
  const double top = v.profile.max().y();
  std::vector<double> rows;
  if (v.kind == VolumeKind::road) {
    rows = {v.profile.u_nearest({-2.2, top}), v.profile.u_nearest({2.2, top})};
  } else {
    rows = {v.profile.u_nearest({0.35 * v.profile.width() * 0.5, top})};
  }
  each(v.equipment.lamps, begin, end, [&](double s, std::uint64_t k) {
    for (std::size_t r = 0; r < rows.size(); ++r) {
      out.push_back({s, rows[r], 1.2, 0.25, static_cast<float>(random.uniform(2 * k + r, 10.0, 25.0))});
    }
  });
  return out;
}

std::vector<Fixture> signs(const WorldDescription& world, const VolumeDescription& v, double begin, double end) {
  std::vector<Fixture> out;
  const RandomStream random = stream(world, v, 22);
  each(v.equipment.signs, begin, end, [&](double s, std::uint64_t k) {
    const double u = v.profile.u_at_height(1.6, k % 2 == 0 ? 1.0 : -1.0);
    out.push_back(
        {s + random.uniform(k + 500000, -0.5, 0.5), u, 0.6, 0.3, static_cast<float>(random.uniform(k, 2.0, 10.0))});
  });
  return out;
}

void add_equipment(Mesh& mesh, const WorldDescription& world, const VolumeDescription& volume, double begin, double end,
                   const std::function<double(const Eigen::Vector3d&)>& neighbour_field) {
  Installer in(mesh, world, volume, neighbour_field);
  if (volume.equipment.geometry) {
    for (const Fixture& f : lamps(world, volume, begin, end)) {
      in.on_wall(f.s, f.u, {f.length, f.width, 0.12}, in.surface(Material::lamp, in.heat(f.temperature, 2)));
    }
    for (const Fixture& f : signs(world, volume, begin, end)) {
      in.on_wall(f.s, f.u, {f.length, f.width, 0.04}, in.surface(Material::sign, in.heat(f.temperature, 2)));
    }
  }
  add_running_equipment(in, begin, end);
  add_single_equipment(in, begin, end);
}

}  // namespace adit::tunnel_simulator
