#include "components/tunnel_simulator/lining_texture.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "components/tunnel_simulator/equipment.hpp"
#include "components/tunnel_simulator/noise.hpp"
#include "components/tunnel_simulator/random.hpp"

namespace adit::tunnel_simulator {
namespace {

std::uint64_t key(const WorldDescription& world, const Chunk& chunk) {
  return mix(world.seed, 7000 + chunk.volume);
}

// The chunk as a picture of kelvin (or of factors), texel centres at (i + 0.5) * texel.
class Canvas {
 public:
  Canvas(const Chunk& chunk, double perimeter, double texel)
      : begin_(chunk.begin),
        texel_(texel),
        width_(std::max(1, static_cast<int>(std::ceil((chunk.end - chunk.begin) / texel)))),
        height_(std::max(1, static_cast<int>(std::ceil(perimeter / texel)))),
        values_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), 0.0F) {}

  int width() const { return width_; }
  int height() const { return height_; }
  std::vector<float>& values() { return values_; }

  // paint(ds, du, value&) for all texels within (rs, ru) of station s, arc length u.
  template <class Paint>
  void around(double s, double u, double rs, double ru, Paint paint) {
    const auto range = [&](double c, double r, int n) {
      return std::pair{std::max(0, static_cast<int>(std::floor((c - r) / texel_))),
                       std::min(n, static_cast<int>(std::ceil((c + r) / texel_)) + 1)};
    };
    const auto [i0, i1] = range(s - begin_, rs, width_);
    const auto [j0, j1] = range(u, ru, height_);
    for (int j = j0; j < j1; ++j) {
      const double du = (j + 0.5) * texel_ - u;
      for (int i = i0; i < i1; ++i) {
        paint((i + 0.5) * texel_ + begin_ - s, du,
              values_[static_cast<std::size_t>(j) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(i)]);
      }
    }
  }
  // Adds amplitude over a rectangle with edges anti-aliased to the texel.
  void rectangle(double s, double u, double length, double height, float amplitude) {
    around(s, u, 0.5 * length + texel_, 0.5 * height + texel_,
           [&](double ds, double du, float& v) { v += amplitude * cover(ds, 0.5 * length) * cover(du, 0.5 * height); });
  }
  void halo(double s, double u, double sigma_s, double sigma_u, float amplitude) {
    around(s, u, 3.5 * sigma_s, 3.5 * sigma_u, [&](double ds, double du, float& v) {
      v += amplitude *
           static_cast<float>(std::exp(-0.5 * (ds * ds / (sigma_s * sigma_s) + du * du / (sigma_u * sigma_u))));
    });
  }
  // Value noise of one wavelength, zero mean, unit variance, times amplitude.
  void add_noise(double wavelength_s, double wavelength_u, float amplitude, std::uint32_t seed) {
    std::vector<float> x(static_cast<std::size_t>(width_));
    for (int i = 0; i < width_; ++i) {
      x[static_cast<std::size_t>(i)] = static_cast<float>(((i + 0.5) * texel_ + begin_) / wavelength_s);
    }
    const NoiseRow noise(x);
    for (int j = 0; j < height_; ++j) {
      const auto y = static_cast<float>((j + 0.5) * texel_ / wavelength_u);
      noise.add(y, seed, amplitude, std::span(values_).subspan(static_cast<std::size_t>(j) * x.size(), x.size()));
    }
  }

 private:
  float cover(double d, double half) const {
    return static_cast<float>(std::clamp((half - std::abs(d)) / texel_ + 0.5, 0.0, 1.0));
  }
  double begin_, texel_;
  int width_, height_;
  std::vector<float> values_;
};

void paint_joints(Canvas& canvas, const VolumeDescription& v, const Chunk& chunk, const RandomStream& random) {
  if (v.lining.block <= 0.0) return;
  const double perimeter = v.profile.perimeter();
  for (auto k = static_cast<std::int64_t>(std::floor(chunk.begin / v.lining.block));
       static_cast<double>(k) * v.lining.block < chunk.end + 1.0; ++k) {
    const double s = static_cast<double>(k) * v.lining.block;
    const auto id = static_cast<std::uint64_t>(k + 1000);
    const float sign = random.uniform(id) < 0.7 ? -1.0F : 1.0F;
    const auto depth = static_cast<float>(random.uniform(id + 100000, 0.1, 0.5));
    canvas.around(s, perimeter / 2.0, 0.6, perimeter / 2.0, [&](double ds, double du, float& value) {
      const auto along = static_cast<float>(du);
      const float vary = 1.0F + 0.4F * value_noise(along * 0.8F, static_cast<float>(id), 77U);
      const float line = static_cast<float>(std::clamp((0.012 - std::abs(ds)) / 0.025 + 0.5, 0.0, 1.0));
      value += sign * depth * vary * (line + 0.3F * static_cast<float>(std::exp(-0.5 * ds * ds / (0.12 * 0.12))));
    });
    // Neighbouring blocks were cast on different days: a small step of the whole block.
    const auto step = static_cast<float>(0.08 * (random.uniform(id + 200000) - 0.5));
    canvas.around(s + v.lining.block / 2, perimeter / 2, v.lining.block / 2, perimeter / 2,
                  [&](double, double, float& value) { value += step; });
  }
}

void paint_seepage(Canvas& canvas, const VolumeDescription& v, const Chunk& chunk, const RandomStream& random) {
  const double cell = 4.0;
  const double perimeter = v.profile.perimeter();
  for (auto k = static_cast<std::int64_t>(std::floor((chunk.begin - 3.0) / cell));
       static_cast<double>(k) * cell < chunk.end + 3.0; ++k) {
    const auto id = static_cast<std::uint64_t>(k + 1000);
    if (random.uniform(id + 300000) > 0.45) continue;
    const double s = (static_cast<double>(k) + random.uniform(id + 400000)) * cell;
    const double u = perimeter * random.uniform(id + 500000, 0.3, 0.97);
    const double size = random.uniform(id + 600000, 0.3, 1.1);
    const auto cold = static_cast<float>(random.uniform(id + 700000, -2.0, -0.5));
    const double down = v.profile.at(u).x() > 0.0 ? -1.0 : 1.0;  // water runs to the floor along the wall
    canvas.around(s, u + down * size, 1.6 * size, 3.2 * size, [&](double ds, double du, float& value) {
      const double below = (du + down * size) * down;  // positive: below the source
      const double stretch = below > 0.0 ? 0.4 : 1.0;
      const double r = std::hypot(ds / size, below * stretch / size) +
                       0.22 * fractal_noise(static_cast<float>(ds * 3.0 + static_cast<double>(k) * 17.0),
                                            static_cast<float>(du * 2.0), 3, 0.6F, 99U);
      value += cold * static_cast<float>(std::clamp(1.3 * (1.0 - r), 0.0, 1.0));
    });
  }
}

void paint_temperature(Canvas& canvas, const WorldDescription& world, const Chunk& chunk) {
  const VolumeDescription& v = world.volumes[chunk.volume];
  const RandomStream random(world.seed, 31 + chunk.volume);
  const auto seed = static_cast<std::uint32_t>(key(world, chunk));
  if (world.texture <= 0) return;
  // 1/f field (3.5 of the localization specification): octaves from 8 m down to 0.12 m, casting blocks stretch it.
  const float rms = world.texture >= 3 ? 0.25F : 0.1F;
  const double finest = v.kind == VolumeKind::open ? 0.4 : 0.12;
  float gain = 1.0F;
  float power = 0.0F;
  for (double w = 8.0; w >= finest; w *= 0.5, gain *= 0.72F) power += gain * gain;
  gain = rms / std::sqrt(power);
  std::uint32_t octave = 0;
  for (double w = 8.0; w >= finest; w *= 0.5, gain *= 0.72F) canvas.add_noise(1.3 * w, w, gain, seed + 131U * octave++);
  if (world.texture < 2) return;

  paint_joints(canvas, v, chunk, random);
  const double reach = 4.0;
  for (const Fixture& f : lamps(world, v, chunk.begin - reach, chunk.end + reach)) {
    canvas.halo(f.s, f.u, 0.9, 0.6, 0.04F * f.temperature);
    if (!v.equipment.geometry) canvas.rectangle(f.s, f.u, f.length, f.width, f.temperature);
  }
  for (const Fixture& f : signs(world, v, chunk.begin - reach, chunk.end + reach)) {
    if (!v.equipment.geometry) canvas.rectangle(f.s, f.u, f.length, f.width, f.temperature);
  }
  for (const auto& [at_begin, is_portal] : {std::pair{true, v.portal_begin}, std::pair{false, v.portal_end}}) {
    if (!is_portal) continue;
    const double portal = at_begin ? 0.0 : v.line.length();
    const double middle = 0.5 * (chunk.begin + chunk.end);
    canvas.around(middle, 0.5 * v.profile.perimeter(), 0.5 * (chunk.end - chunk.begin), 0.5 * v.profile.perimeter(),
                  [&](double ds, double, float& value) {
                    const double depth = std::abs(middle + ds - portal);
                    value += static_cast<float>(world.temperatures.portal * std::exp(-depth / 60.0));
                  });
  }
  if (world.texture < 3 || v.kind == VolumeKind::open) return;
  paint_seepage(canvas, v, chunk, random);
  if (v.equipment.tray) {
    const double u = v.profile.u_at_height(0.62 * v.profile.max().y(), -1.0);
    canvas.around(
        0.5 * (chunk.begin + chunk.end), u, 0.5 * (chunk.end - chunk.begin), 1.0,
        [&](double, double du, float& value) { value += 0.5F * static_cast<float>(std::exp(-du * du / 0.08)); });
  }
}

void paint_reflectivity(Canvas& canvas, const WorldDescription& world, const Chunk& chunk) {
  const VolumeDescription& v = world.volumes[chunk.volume];
  const auto seed = static_cast<std::uint32_t>(key(world, chunk)) + 9001U;
  const float rms = properties(v.lining.material).reflectivity_texture;
  for (float& value : canvas.values()) value = 1.0F;
  canvas.add_noise(3.0, 2.0, 0.6F * rms, seed);
  canvas.add_noise(0.6, 0.5, 0.6F * rms, seed + 1);
  canvas.add_noise(0.2, 0.2, 0.5F * rms, seed + 2);
  if (v.lining.block > 0.0) {
    for (double s = std::floor(chunk.begin / v.lining.block) * v.lining.block; s < chunk.end + 0.1;
         s += v.lining.block) {
      canvas.rectangle(s, 0.5 * v.profile.perimeter(), 0.03, v.profile.perimeter(), -0.25F);
    }
  }
  if (v.kind == VolumeKind::road) {  // the floor's arc length starts at its right edge
    const double half = -v.profile.sampled(1000.0).front().position.x();
    const double middle = 0.5 * (chunk.begin + chunk.end);
    for (double l : {-half + 0.2, half - 0.2}) canvas.rectangle(middle, l + half, chunk.end - chunk.begin, 0.15, 2.5F);
    for (double s = std::floor(chunk.begin / 12.0) * 12.0; s < chunk.end + 6.0; s += 12.0) {
      canvas.rectangle(s + 3.0, half, 6.0, 0.15, 2.5F);
    }
  }
}

}  // namespace

LiningTexture::LiningTexture(const WorldDescription& world, const Chunk& chunk, bool thermal) {
  const VolumeDescription& v = world.volumes[chunk.volume];
  const bool open = v.kind == VolumeKind::open;
  const double reflectivity_texel = open ? 0.25 : 0.05;
  reflectivity_per_metre_ = static_cast<float>(1.0 / reflectivity_texel);
  Canvas factors(chunk, v.profile.perimeter(), reflectivity_texel);
  paint_reflectivity(factors, world, chunk);
  reflectivity_width_ = factors.width();
  reflectivity_height_ = factors.height();
  reflectivity_.reserve(factors.values().size());
  for (float f : factors.values()) {
    reflectivity_.push_back(static_cast<std::uint8_t>(std::lround(std::clamp(64.0F * f, 0.0F, 255.0F))));
  }
  if (!thermal) return;

  const float texel = open ? 0.1F : 0.025F;
  Chunk padded = chunk;  // so that filtering near the chunk's border sees what lies beyond
  padded.begin -= LiningTexture::kMargin;
  padded.end += LiningTexture::kMargin;
  Canvas kelvin(padded, v.profile.perimeter(), texel);
  paint_temperature(kelvin, world, padded);
  levels_[0] = {kelvin.width(), kelvin.height(), 0, 1.0F / texel, 1.0F / texel};
  temperature_.reserve(kelvin.values().size() * 4);
  for (float k : kelvin.values()) {
    temperature_.push_back(static_cast<std::int16_t>(std::lround(std::clamp(1000.0F * k, -32000.0F, 32000.0F))));
  }
  log_texels_ = std::log2(1.0F / texel);
  build_levels();
}

void LiningTexture::build_levels() {
  const auto index = [](int ls, int lu) { return static_cast<std::size_t>(lu * kLevelsS + ls); };
  for (int lu = 0; lu < kLevelsU; ++lu) {
    for (int ls = 0; ls < kLevelsS; ++ls) {
      if (ls == 0 && lu == 0) continue;
      const bool halve_s = ls > 0;
      const Level from = levels_[halve_s ? index(ls - 1, lu) : index(0, lu - 1)];
      // At least two texels each way: sample() reads pairs.
      Level to{halve_s ? std::max(2, (from.width + 1) / 2) : from.width,
               halve_s ? from.height : std::max(2, (from.height + 1) / 2), temperature_.size(),
               halve_s ? 0.5F * from.per_s : from.per_s, halve_s ? from.per_u : 0.5F * from.per_u};
      levels_[index(ls, lu)] = to;
      const auto at = [&](int x, int y) {
        return temperature_[from.offset +
                            static_cast<std::size_t>(std::min(y, from.height - 1)) *
                                static_cast<std::size_t>(from.width) +
                            static_cast<std::size_t>(std::min(x, from.width - 1))];
      };
      for (int y = 0; y < to.height; ++y) {
        for (int x = 0; x < to.width; ++x) {
          const int sum = halve_s ? at(2 * x, y) + at(2 * x + 1, y) : at(x, 2 * y) + at(x, 2 * y + 1);
          temperature_.push_back(static_cast<std::int16_t>(sum >> 1));
        }
      }
    }
  }
}

}  // namespace adit::tunnel_simulator
