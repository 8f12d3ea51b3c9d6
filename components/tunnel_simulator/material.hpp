// What a surface is made of, for the LiDAR (865 nm) and the thermal camera (8-14 um).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace adit::tunnel_simulator {

enum class Material : std::uint8_t {
  concrete,
  shotcrete,
  rock,
  asphalt,
  kerb,
  ballast,
  painted_metal,
  bare_metal,
  plastic,
  rubber,
  glass,
  vegetation,
  soil,
  sign,
  lamp,
  wood,
  count
};

struct MaterialProperties {
  float reflectivity;          // diffuse, at normal incidence
  float reflectivity_texture;  // relative rms variation over the surface
  float emissivity;            // 8-14 um, hemispherical
  float retro;                 // extra return of retroreflective sheeting, as a reflectivity
};

inline const MaterialProperties& properties(Material material) {
  static constexpr std::array<MaterialProperties, static_cast<std::size_t>(Material::count)> kTable{{
      {0.35F, 0.08F, 0.94F, 0.0F},  // concrete
      {0.30F, 0.12F, 0.94F, 0.0F},  // shotcrete
      {0.25F, 0.20F, 0.95F, 0.0F},  // rock
      {0.12F, 0.15F, 0.95F, 0.0F},  // asphalt
      {0.40F, 0.08F, 0.94F, 0.0F},  // kerb
      {0.22F, 0.25F, 0.95F, 0.0F},  // ballast
      {0.45F, 0.03F, 0.92F, 0.0F},  // painted metal
      {0.30F, 0.03F, 0.25F, 0.0F},  // bare metal
      {0.20F, 0.03F, 0.93F, 0.0F},  // plastic
      {0.05F, 0.03F, 0.94F, 0.0F},  // rubber
      {0.08F, 0.00F, 0.90F, 0.0F},  // glass
      {0.45F, 0.30F, 0.97F, 0.0F},  // vegetation
      {0.25F, 0.25F, 0.95F, 0.0F},  // soil
      {0.50F, 0.05F, 0.90F, 5.0F},  // sign
      {0.60F, 0.02F, 0.90F, 0.0F},  // lamp
      {0.40F, 0.10F, 0.92F, 0.0F},  // wood
  }};
  return kTable[static_cast<std::size_t>(material)];
}

}  // namespace adit::tunnel_simulator
