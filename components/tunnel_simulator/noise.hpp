// Deterministic lattice noise: the same field value at the same place for ever, from a seed.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace adit::tunnel_simulator {

// Value noise with quintic fade, zero mean, unit variance over the plane / the space; lattice pitch 1.
float value_noise(float x, float y, std::uint32_t seed);
float value_noise(float x, float y, float z, std::uint32_t seed);

// `octaves` layers, each of half the wavelength and `gain` times the amplitude of the one before, starting at
// wavelength 1; unit variance.
float fractal_noise(float x, float y, int octaves, float gain, std::uint32_t seed);
float fractal_noise(float x, float y, float z, int octaves, float gain, std::uint32_t seed);

// value_noise(x, y, seed) along rows y = constant at the same rising places x, a few to a lattice cell: what does not
// change from row to row or within a cell is done once.
class NoiseRow {
 public:
  explicit NoiseRow(std::span<const float> x);
  // out[i] += amplitude * value_noise(x[i], y, seed), to round-off.
  void add(float y, std::uint32_t seed, float amplitude, std::span<float> out) const;

 private:
  struct Cell {
    std::int32_t index;
    std::size_t end;  // of its places
  };
  std::vector<Cell> cells_;
  std::vector<float> fades_;
};

}  // namespace adit::tunnel_simulator
