#include "components/tunnel_simulator/noise.hpp"

#include <cmath>

namespace adit::tunnel_simulator {
namespace {

// Standard deviation of interpolated uniform(-1, 1) lattice values: sqrt(q^n / 3), q = 1 - 2 * integral f (1 - f) with
// the quintic fade f, q = 0.78355.
constexpr float kScale2 = 1.0F / 0.45239F;
constexpr float kScale3 = 1.0F / 0.40045F;

std::uint32_t hash(std::uint32_t x) {
  x ^= x >> 16;
  x *= 0x7feb352dU;
  x ^= x >> 15;
  x *= 0x846ca68bU;
  return x ^ (x >> 16);
}

float lattice(std::int32_t x, std::int32_t y, std::uint32_t seed) {
  const std::uint32_t h =
      hash(hash(static_cast<std::uint32_t>(x) + seed) ^ (static_cast<std::uint32_t>(y) * 0x9e3779b9U));
  return static_cast<float>(static_cast<std::int32_t>(h)) * 0x1p-31F;
}

float fade(float t) {
  return t * t * t * (t * (t * 6.0F - 15.0F) + 10.0F);
}
float mix(float a, float b, float t) {
  return a + (b - a) * t;
}

float plane(float x, float y, std::uint32_t seed) {
  const float fx = std::floor(x);
  const float fy = std::floor(y);
  const auto ix = static_cast<std::int32_t>(fx);
  const auto iy = static_cast<std::int32_t>(fy);
  const float tx = fade(x - fx);
  const float ty = fade(y - fy);
  return mix(mix(lattice(ix, iy, seed), lattice(ix + 1, iy, seed), tx),
             mix(lattice(ix, iy + 1, seed), lattice(ix + 1, iy + 1, seed), tx), ty);
}

template <class Layer>
float fractal(int octaves, float gain, Layer layer) {
  float sum = 0.0F;
  float power = 0.0F;
  float amplitude = 1.0F;
  float frequency = 1.0F;
  for (int i = 0; i < octaves; ++i) {
    sum += amplitude * layer(frequency, static_cast<std::uint32_t>(i));
    power += amplitude * amplitude;
    amplitude *= gain;
    frequency *= 2.0F;
  }
  return power > 0.0F ? sum / std::sqrt(power) : 0.0F;
}

}  // namespace

float value_noise(float x, float y, std::uint32_t seed) {
  return kScale2 * plane(x, y, seed);
}

float value_noise(float x, float y, float z, std::uint32_t seed) {
  const float fz = std::floor(z);
  const auto iz = static_cast<std::uint32_t>(static_cast<std::int32_t>(fz));
  return kScale3 * mix(plane(x, y, hash(seed + iz)), plane(x, y, hash(seed + iz + 1)), fade(z - fz));
}

float fractal_noise(float x, float y, int octaves, float gain, std::uint32_t seed) {
  return fractal(octaves, gain,
                 [&](float f, std::uint32_t i) { return value_noise(x * f, y * f, seed + i * 0x51ed270bU); });
}

float fractal_noise(float x, float y, float z, int octaves, float gain, std::uint32_t seed) {
  return fractal(octaves, gain,
                 [&](float f, std::uint32_t i) { return value_noise(x * f, y * f, z * f, seed + i * 0x51ed270bU); });
}

NoiseRow::NoiseRow(std::span<const float> x) {
  for (const float place : x) {
    const float cell = std::floor(place);
    const auto index = static_cast<std::int32_t>(cell);
    if (cells_.empty() || cells_.back().index != index) cells_.push_back({index, fades_.size()});
    fades_.push_back(fade(place - cell));
    cells_.back().end = fades_.size();
  }
}

void NoiseRow::add(float y, std::uint32_t seed, float amplitude, std::span<float> out) const {
  const float cell = std::floor(y);
  const auto iy = static_cast<std::int32_t>(cell);
  const float ty = fade(y - cell);
  const auto column = [&](std::int32_t ix) {
    return amplitude * kScale2 * mix(lattice(ix, iy, seed), lattice(ix, iy + 1, seed), ty);
  };
  std::size_t i = 0;
  for (const Cell& c : cells_) {
    const float left = column(c.index);
    const float step = column(c.index + 1) - left;
    for (; i < c.end; ++i) out[i] += left + fades_[i] * step;
  }
}

}  // namespace adit::tunnel_simulator
