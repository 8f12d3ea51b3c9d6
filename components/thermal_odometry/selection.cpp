#include "components/thermal_odometry/selection.hpp"

#include <algorithm>
#include <cmath>

namespace adit::thermal_odometry {
namespace {

Eigen::Vector2f gradient(const Image& image, int x, int y) {
  const float* p = image.row(y) + x;
  return {0.5F * (p[1] - p[-1]), 0.5F * (p[image.width] - p[-image.width])};
}

// Of a grid with so many cells [px].
int cell_size(int width, int height, int cells) {
  return std::max(4,
                  static_cast<int>(std::lround(std::sqrt(static_cast<double>(width) * height / std::max(1, cells)))));
}

}  // namespace

PixelSelector::PixelSelector(int width, int height, const Config& config)
    : config_(config),
      cell_(cell_size(width, height, config.wanted)),
      texture_cell_(cell_size(width, height, texture_cells)),
      texture_columns_(width / texture_cell_ + 1) {
  texture_.resize(static_cast<std::size_t>(texture_columns_ * (height / texture_cell_ + 1)));
  selected_.reserve(static_cast<std::size_t>((width / cell_ + 1) * (height / cell_ + 1)));
  clear_.reserve(selected_.capacity());
  scratch_.reserve(static_cast<std::size_t>((width / 4 + 1) * (height / 4 + 1)));
}

std::span<const Pixel> PixelSelector::select(const Pyramid& pyramid, const Rectifier& rectifier) {
  const Image& image = pyramid.level(0);
  const Image& half = pyramid.level(std::min(1, pyramid.levels() - 1));
  const int border = config_.border;
  scratch_.clear();
  for (int y = border; y < image.height - border; y += 4) {
    for (int x = border; x < image.width - border; x += 4) scratch_.push_back(gradient(image, x, y).squaredNorm());
  }
  // Gradient magnitude of pure noise is Rayleigh distributed: its lower decile is 0.459 sigma.
  const auto decile = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 10);
  std::nth_element(scratch_.begin(), decile, scratch_.end());
  threshold_ = std::max(config_.min_gradient, config_.noise_factor * std::sqrt(*decile) / 0.459F);

  const float half_threshold = std::max(config_.confirmation * threshold_, config_.min_confirmation);
  const auto half_gradient = [&half](int x, int y) {
    return gradient(half, std::clamp(x / 2, 1, half.width - 2), std::clamp(y / 2, 1, half.height - 2));
  };
  std::fill(texture_.begin(), texture_.end(), std::uint8_t{0});
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
          const Eigen::Vector2f g = gradient(image, x, y);
          const float g2 = g.squaredNorm();
          if (g2 <= threshold2) continue;
          const Eigen::Vector2f coarse = half_gradient(x, y);
          if (coarse.squaredNorm() > config_.strong * config_.strong) {
            texture_[static_cast<std::size_t>(y / texture_cell_ * texture_columns_ + x / texture_cell_)] = 1;
          }
          if (g2 > best && coarse.dot(g) > half_threshold * std::sqrt(g2)) {
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
  strong_cells_ = static_cast<int>(std::count(texture_.begin(), texture_.end(), std::uint8_t{1}));
  return selected_;
}

std::span<const Pixel> PixelSelector::clear_ones() {
  clear_.clear();
  for (const Pixel& pixel : selected_) {
    if (pixel.gradient > config_.clear * threshold_) clear_.push_back(pixel);
  }
  return clear_;
}

}  // namespace adit::thermal_odometry
