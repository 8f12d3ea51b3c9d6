// Deterministic lattice noise: the same field value at the same place for ever, from a seed.
#pragma once

#include <cstdint>

namespace adit::tunnel_simulator {

// Value noise with quintic fade, zero mean, unit variance over the plane / the space; lattice pitch 1.
float value_noise(float x, float y, std::uint32_t seed);
float value_noise(float x, float y, float z, std::uint32_t seed);

// `octaves` layers, each of half the wavelength and `gain` times the amplitude of the one before, starting at
// wavelength 1; unit variance.
float fractal_noise(float x, float y, int octaves, float gain, std::uint32_t seed);
float fractal_noise(float x, float y, float z, int octaves, float gain, std::uint32_t seed);

}  // namespace adit::tunnel_simulator
