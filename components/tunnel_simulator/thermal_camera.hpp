// An uncooled thermal camera (FLIR ADK / Boson): radiance of what each row sees at its own time, blur by the
// microbolometer's time constant, fixed patterns that grow since the last shutter correction (FFC), 16-bit counts.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <vector>

#include "components/geometry/se3.hpp"
#include "components/tunnel_simulator/atmosphere.hpp"
#include "components/tunnel_simulator/camera_model.hpp"
#include "components/tunnel_simulator/pixel_lag.hpp"
#include "components/tunnel_simulator/ray_caster.hpp"

namespace adit::tunnel_simulator {

// Band radiance 8-14 um of a black body over temperature, by Planck's law.
class BandRadiance {
 public:
  BandRadiance();
  float at(float celsius) const {  // [W / (m2 sr)], -60 .. 200 degrees
    const float x = std::clamp((celsius - kBegin) / kStep, 0.0F, static_cast<float>(table_.size()) - 1.001F);
    const auto i = static_cast<std::size_t>(x);
    return table_[i] + (x - static_cast<float>(i)) * (table_[i + 1] - table_[i]);
  }
  float slope_at(float celsius) const;  // [W / (m2 sr K)]
 private:
  static constexpr float kBegin = -60.0F, kEnd = 200.0F, kStep = 0.25F;
  std::vector<float> table_;
};

struct ThermalConfig {
  CameraModel camera = CameraModel::from_hfov(640, 512, 75.0 * 3.14159265358979323846 / 180.0);
  double rate = 30.0;               // [Hz]
  double row_time = 32e-6;          // rolling readout [s]; 0: global shutter
  double time_constant = 0.010;     // of the pixels [s]; 0: none
  double blur = 0.6;                // optics, rms [px]; 0: none
  double counts_per_kelvin = 50.0;  // at the wall's temperature
  double counts_at_wall = 6000.0;
  double netd = 0.040;            // temporal noise, rms [K]
  double column_noise = 0.012;    // temporal, rms [K]
  double pattern = 0.010;         // fixed pattern right after an FFC, rms [K]
  double pattern_growth = 0.008;  // ... plus this times sqrt(minutes since FFC) [K]
  double drift = 0.10;            // offset drift, rms rate [K/min]; the FFC takes it back
  double ffc_first = 60.0;        // [s]; < 0: never
  double ffc_interval = 180.0;    // [s]
  double ffc_duration = 0.4;      // frozen stream [s]
  bool noise = true;              // temporal, column and pattern noise, drift, quantisation to counts
  bool edges = true;              // four sub-rays at the edges of objects
};

enum class FfcState : std::uint8_t { idle = 0, in_progress = 1, complete = 2 };

struct ThermalImage {
  std::int64_t stamp_ns = 0;  // middle of the readout
  int width = 0, height = 0;
  std::vector<std::uint16_t> counts;
  FfcState ffc = FfcState::idle;
  bool frozen = false;     // repeats the last frame before the shutter closed
  double since_ffc = 0.0;  // [s]
  double focal_plane_celsius = 0.0;
};

class ThermalCamera {
 public:
  ThermalCamera(ThermalConfig config, std::uint64_t seed);
  const ThermalConfig& config() const { return config_; }
  const BandRadiance& radiance() const { return band_; }
  // Readout time from the first row to the middle of the image: the stamp's delay [s].
  double half_readout() const { return 0.5 * config_.row_time * config_.camera.height; }

  using PoseAt = std::function<Pose(double)>;  // world <- optical frame
  // The frame whose first row is read at `time`. `image` must be the one of the frame before (a closed shutter
  // repeats it). The caster must be looking from near the camera.
  void capture(const RayCaster& caster, const Atmosphere& atmosphere, const PoseAt& pose, double time,
               std::uint64_t frame, int threads, ThermalImage& image);

 private:
  struct Pixels {                  // of a packet
    RayPacket::F radiance, range;  // range 0: nothing hit
    RayPacket::U key;              // of the thing hit: different keys, different things
  };
  struct TileRays {  // of 4 x 4 pixels, camera frame
    RayPacket::F x, y, z;
  };
  void render_tile_row(const RayCaster& caster, const Atmosphere& atmosphere, int tile_row);
  void resample_edges(const RayCaster& caster, const Atmosphere& atmosphere, int row);
  // `from`: where the packet's rays start, near enough for smoke.
  void shade(const RayCaster& caster, const Atmosphere& atmosphere, const RayPacket& packet,
             const Eigen::Vector3d& from, Pixels& out) const;
  void optics(int threads);
  void update_pattern(double time, int threads);
  void digitize(int row, double time, std::uint64_t frame, ThermalImage& image) const;
  std::size_t row_begin(int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(config_.camera.width);
  }

  ThermalConfig config_;
  std::uint64_t seed_;
  PixelLag lag_;
  BandRadiance band_;
  float wall_celsius_ = 10.0F, air_radiance_ = 0.0F, sky_radiance_ = 0.0F, wall_radiance_ = 0.0F;
  std::vector<TileRays> tiles_;                   // row by row
  std::vector<float> plane_x_, plane_y_, ray_z_;  // per pixel: x / z, y / z and z of the unit ray
  std::vector<Pose> poses_;                       // per row
  std::vector<float> radiance_, range_;           // per pixel, as in Pixels
  std::vector<std::uint32_t> key_;
  std::vector<float> radiance_image_, work_;
  std::vector<float> pattern_;
  std::vector<float> kernel_, columns_;
  std::int64_t pattern_epoch_ = -1;
};

}  // namespace adit::tunnel_simulator
