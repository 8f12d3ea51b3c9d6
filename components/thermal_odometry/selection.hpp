// Gradient-based pixel selection (paper R25; Engel et al., DSO, 2018, section 3.2, with the grid of LDSO).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "components/thermal_odometry/camera.hpp"
#include "components/thermal_odometry/pyramid.hpp"

namespace adit::thermal_odometry {

struct Pixel {
  float u;  // level 0
  float v;
  float gradient;  // noise units a pixel
};

class PixelSelector {
 public:
  struct Config {
    int wanted = 900;
    float min_gradient = 0.5F;       // noise units a pixel
    float noise_factor = 3.5F;       // times the gradient noise measured in the flattest tenth of the image
    float clear = 1.3F;              // times the threshold, where depth has to come from motion
    float confirmation = 0.7F;       // of the threshold, on level 1, and at least
    float min_confirmation = 0.65F;  // noise units a level-1 pixel
    float strong = 3.0F;             // level-1 gradient that noise and fixed patterns do not reach
    int border = 8;                  // px
  };
  PixelSelector(int width, int height, const Config& config);
  // The strongest gradient above the threshold in each grid cell that the next level confirms, by one of the same
  // direction: a bad pixel or a grain of fixed-pattern noise has no gradient there. Rather few real points than many of
  // noise: an image without texture gives next to none. The span is valid until the next call.
  std::span<const Pixel> select(const Pyramid& pyramid, const Rectifier& rectifier);
  // Those of the last call with a gradient clear enough to get a depth from motion alone. Valid until the next call.
  std::span<const Pixel> clear_ones();
  // Threshold the last call used.
  float threshold() const { return threshold_; }
  // How many of texture_cells parts of the last image hold a strong gradient: the measure of whether there is anything
  // to see.
  static constexpr int texture_cells = 500;
  int strong_cells() const { return strong_cells_; }

 private:
  Config config_;
  int cell_;
  int texture_cell_;
  int texture_columns_;
  std::vector<std::uint8_t> texture_;
  float threshold_ = 0.0F;
  int strong_cells_ = 0;
  std::vector<Pixel> selected_;
  std::vector<Pixel> clear_;
  std::vector<float> scratch_;
};

}  // namespace adit::thermal_odometry
