#include "components/thermal_odometry/pyramid.hpp"

#include <algorithm>

namespace adit::thermal_odometry {

void Pyramid::allocate(int width, int height) {
  levels_ = 0;
  while (levels_ < max_levels && std::min(width, height) >= 30) {
    Image& image = images_[static_cast<std::size_t>(levels_++)];
    image.width = width;
    image.height = height;
    image.pixels.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0.0F);
    width /= 2;
    height /= 2;
  }
}

void Pyramid::reduce() {
  for (int l = 1; l < levels_; ++l) {
    const Image& fine = images_[static_cast<std::size_t>(l - 1)];
    Image& coarse = images_[static_cast<std::size_t>(l)];
    for (int y = 0; y < coarse.height; ++y) {
      const float* upper = fine.row(2 * y);
      const float* lower = fine.row(2 * y + 1);
      float* out = coarse.row(y);
      for (int x = 0; x < coarse.width; ++x) {
        out[x] = 0.25F * ((upper[2 * x] + upper[2 * x + 1]) + (lower[2 * x] + lower[2 * x + 1]));
      }
    }
  }
}

}  // namespace adit::thermal_odometry
