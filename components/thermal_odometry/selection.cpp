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

std::span<const Pixel> PixelSelector::select(const Pyramid& pyramid, const Rectifier& rectifier) {
  const Image& image = pyramid.level(0);
  const Image& half = pyramid.level(std::min(1, pyramid.levels() - 1));
  const int border = config_.border;
  scratch_.clear();
  for (int y = border; y < image.height - border; y += 4) {
    for (int x = border; x < image.width - border; x += 4) scratch_.push_back(gradient2(image, x, y));
  }
  // Gradient magnitude of pure noise is Rayleigh distributed: its lower decile is 0.459 sigma.
  const auto decile = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 10);
  std::nth_element(scratch_.begin(), decile, scratch_.end());
  threshold_ = std::max(config_.min_gradient, config_.noise_factor * std::sqrt(*decile) / 0.459F);

  const float half_threshold2 = std::pow(std::max(config_.confirmation * threshold_, config_.min_confirmation), 2.0F);
  const auto half_gradient2 = [&half](int x, int y) {
    return gradient2(half, std::clamp(x / 2, 1, half.width - 2), std::clamp(y / 2, 1, half.height - 2));
  };
  strong_cells_ = 0;
  selected_.clear();
  const float threshold2 = threshold_ * threshold_;
  for (int y0 = border; y0 < image.height - border; y0 += cell_) {
    const int y1 = std::min(y0 + cell_, image.height - border);
    for (int x0 = border; x0 < image.width - border; x0 += cell_) {
      const int x1 = std::min(x0 + cell_, image.width - border);
      float best = threshold2;
      int best_x = -1;
      int best_y = -1;
      bool strong = false;
      for (int y = y0; y < y1; ++y) {
        for (int x = x0; x < x1; ++x) {
          const float g2 = gradient2(image, x, y);
          if (g2 <= threshold2) continue;
          const float coarse = half_gradient2(x, y);
          strong = strong || coarse > config_.strong * config_.strong;
          if (g2 > best && coarse > half_threshold2) {
            best = g2;
            best_x = x;
            best_y = y;
          }
        }
      }
      strong_cells_ += strong ? 1 : 0;
      if (best_x < 0 || !rectifier.covered(best_x, best_y)) continue;
      selected_.push_back({static_cast<float>(best_x), static_cast<float>(best_y), std::sqrt(best)});
    }
  }
  return selected_;
}

}  // namespace adit::thermal_odometry
