#include "components/thermal_odometry/selection.hpp"

#include <algorithm>
#include <cmath>

namespace adit::thermal_odometry {
namespace {

float gradient2(const Image& image, int x, int y) {
  const float* p = image.row(y) + x;
  const float gx = 0.5F * (p[1] - p[-1]);
  const float gy = 0.5F * (p[image.width] - p[-image.width]);
  return gx * gx + gy * gy;
}

}  // namespace

PixelSelector::PixelSelector(int width, int height, const Config& config) : config_(config) {
  cell_ = std::max(
      4, static_cast<int>(std::lround(std::sqrt(static_cast<double>(width) * height / std::max(1, config.wanted)))));
  selected_.reserve(static_cast<std::size_t>((width / cell_ + 1) * (height / cell_ + 1)));
  scratch_.reserve(static_cast<std::size_t>((width / 4 + 1) * (height / 4 + 1)));
}

std::span<const Pixel> PixelSelector::select(const Image& image, const Rectifier& rectifier) {
  const int border = config_.border;
  scratch_.clear();
  for (int y = border; y < image.height - border; y += 4) {
    for (int x = border; x < image.width - border; x += 4) scratch_.push_back(gradient2(image, x, y));
  }
  // Gradient magnitude of pure noise is Rayleigh distributed: its lower decile is 0.459 sigma.
  const auto decile = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 10);
  std::nth_element(scratch_.begin(), decile, scratch_.end());
  threshold_ = std::max(config_.min_gradient, config_.noise_factor * std::sqrt(*decile) / 0.459F);

  selected_.clear();
  const float threshold2 = threshold_ * threshold_;
  for (int y0 = border; y0 < image.height - border; y0 += cell_) {
    const int y1 = std::min(y0 + cell_, image.height - border);
    for (int x0 = border; x0 < image.width - border; x0 += cell_) {
      const int x1 = std::min(x0 + cell_, image.width - border);
      float best = threshold2;
      int best_x = -1;
      int best_y = -1;
      for (int y = y0; y < y1; ++y) {
        for (int x = x0; x < x1; ++x) {
          const float g2 = gradient2(image, x, y);
          if (g2 > best) {
            best = g2;
            best_x = x;
            best_y = y;
          }
        }
      }
      if (best_x < 0 || !rectifier.covered(best_x, best_y)) continue;
      selected_.push_back({static_cast<float>(best_x), static_cast<float>(best_y), std::sqrt(best)});
    }
  }
  return selected_;
}

}  // namespace adit::thermal_odometry
