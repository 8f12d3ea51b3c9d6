// Temperature and reflectivity of one chunk's lining over (s, u), baked once and filtered for the pixel's footprint.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "components/tunnel_simulator/world.hpp"

namespace adit::tunnel_simulator {

// Rip-map (mip levels of s and of u apart, as grazing views need): temperature in millikelvin above the undisturbed
// wall.
class LiningTexture {
 public:
  static constexpr float kMargin = 0.8F;  // how far the baked picture reaches beyond the chunk along s [m]
  LiningTexture() = default;
  // Bakes the chunk. `thermal` off: reflectivity only.
  LiningTexture(const WorldDescription& world, const Chunk& chunk, bool thermal);

  // Kelvin at (s, u) [m from the chunk's begin], averaged over a footprint given by the binary logarithms of its sizes
  // along s and u in metres. No texture: 0.
  float temperature(float s, float u, float log_s, float log_u) const;
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
  float log_texels_ = 0.0F;  // binary logarithm of the finest level's texels a metre
  std::vector<std::int16_t> temperature_;
  int reflectivity_width_ = 0, reflectivity_height_ = 0;
  float reflectivity_per_metre_ = 20.0F;
  std::vector<std::uint8_t> reflectivity_;
};

// Binary logarithm of a positive normal number to 0.009: exponent, and a parabola through the mantissa.
inline float log2_of(float x) {
  const auto bits = std::bit_cast<std::uint32_t>(x);
  const float t = std::bit_cast<float>((bits & 0x7fffffU) | 0x3f800000U) - 1.0F;
  return static_cast<float>(static_cast<int>(bits >> 23) - 127) + t + 0.343F * t * (1.0F - t);
}

inline float LiningTexture::sample(const Level& level, float x, float y) const {
  x = std::clamp(x - 0.5F, 0.0F, static_cast<float>(level.width) - 1.001F);
  y = std::clamp(y - 0.5F, 0.0F, static_cast<float>(level.height) - 1.001F);
  const int x0 = static_cast<int>(x);
  const int y0 = static_cast<int>(y);
  const float tx = x - static_cast<float>(x0);
  const float ty = y - static_cast<float>(y0);
  const std::int16_t* low = temperature_.data() + level.offset + y0 * level.width + x0;
  const std::int16_t* high = low + level.width;
  const auto lower = static_cast<float>(low[0]), upper = static_cast<float>(high[0]);
  const float a = lower + tx * (static_cast<float>(low[1]) - lower);
  const float b = upper + tx * (static_cast<float>(high[1]) - upper);
  return a + ty * (b - a);
}

inline float LiningTexture::temperature(float s, float u, float log_s, float log_u) const {
  if (temperature_.empty()) return 0.0F;
  const float level_s = std::clamp(log_s + log_texels_, 0.0F, kLevelsS - 1.001F);
  const float level_u = std::clamp(log_u + log_texels_ + 0.5F, 0.0F, kLevelsU - 1.0F);
  const int ls = static_cast<int>(level_s);
  const int lu = static_cast<int>(level_u);
  const float blend = level_s - static_cast<float>(ls);
  const Level& level = levels_[static_cast<std::size_t>(lu * kLevelsS + ls)];
  const float x = (s + kMargin) * level.per_s;
  const float y = u * level.per_u;
  const float a = sample(level, x, y);
  if (blend <= 0.0F) return 1e-3F * a;
  return 1e-3F * (a + blend * (sample((&level)[1], 0.5F * x, y) - a));
}

inline float LiningTexture::reflectivity(float s, float u) const {
  const int x = std::clamp(static_cast<int>(s * reflectivity_per_metre_), 0, reflectivity_width_ - 1);
  const int y = std::clamp(static_cast<int>(u * reflectivity_per_metre_), 0, reflectivity_height_ - 1);
  return static_cast<float>(reflectivity_[static_cast<std::size_t>(y) * static_cast<std::size_t>(reflectivity_width_) +
                                          static_cast<std::size_t>(x)]) *
         (1.0F / 64.0F);
}

}  // namespace adit::tunnel_simulator
