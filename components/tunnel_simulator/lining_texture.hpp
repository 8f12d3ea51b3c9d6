// Temperature and reflectivity of one chunk's lining over (s, u), baked once and filtered for the pixel's footprint.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "components/tunnel_simulator/world.hpp"

namespace adit::tunnel_simulator {

// Rip-map (mip levels of s and of u apart, as grazing views need): temperature in millikelvin above the undisturbed
// wall.
class LiningTexture {
 public:
  LiningTexture() = default;
  // Bakes the chunk. `thermal` off: reflectivity only.
  LiningTexture(const WorldDescription& world, const Chunk& chunk, bool thermal);

  // Kelvin at (s, u) [m from the chunk's begin], averaged over a footprint given by its squared sizes along s and u
  // [m2]. No texture: 0.
  float temperature(float s, float u, float footprint_s2, float footprint_u2) const;
  // Factor on the material's reflectivity.
  float reflectivity(float s, float u) const;

 private:
  static constexpr int kLevelsS = 6;
  static constexpr int kLevelsU = 4;
  struct Level {
    int width = 0, height = 0;  // texels along s and u
    std::size_t offset = 0;
    float per_s = 0.0F, per_u = 0.0F;  // texels a metre
  };
  float sample(const Level& level, float x, float y) const;
  void build_levels();

  std::array<Level, static_cast<std::size_t>(kLevelsS) * kLevelsU> levels_{};
  std::vector<std::int16_t> temperature_;
  int reflectivity_width_ = 0, reflectivity_height_ = 0;
  float reflectivity_per_metre_ = 20.0F;
  std::vector<std::uint8_t> reflectivity_;
};

}  // namespace adit::tunnel_simulator
