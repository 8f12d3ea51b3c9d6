// Image pyramid in noise units (temporal noise = 1) and the sub-pixel look-up all photometric code uses.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

namespace adit::thermal_odometry {

struct Image {
  int width = 0;
  int height = 0;
  std::vector<float> pixels;  // row-major, no padding
  const float* row(int y) const {
    return pixels.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
  }
  float* row(int y) { return pixels.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width); }
};

// Level l+1 is the mean of 2 x 2 pixels of level l. Gradients are not stored: four rows of four values give value and
// gradient of a sub-pixel position (1.75 MB a 640 x 512 frame instead of 7 MB, and a front end that writes less).
class Pyramid {
 public:
  static constexpr int max_levels = 5;
  void allocate(int width, int height);
  int levels() const { return levels_; }
  Image& base() { return images_[0]; }
  const Image& level(int l) const { return images_[static_cast<std::size_t>(l)]; }
  // Fills levels 1.. from the base.
  void reduce();

 private:
  std::array<Image, max_levels> images_;
  int levels_ = 0;
};

struct Sample {
  float value;
  float gx;
  float gy;
};

// Precondition of sample(): a 4 x 4 neighbourhood exists.
inline bool samplable(const Image& image, float x, float y) {
  return x >= 1.0F && y >= 1.0F && x < static_cast<float>(image.width - 2) && y < static_cast<float>(image.height - 2);
}

// Bilinear value, and the bilinear interpolation of the central-difference gradients (smoother than the derivative of
// the interpolant, which is what makes direct alignment converge: Engel et al., DSO, 2018).
inline Sample sample(const Image& image, float x, float y) {
  const int ix = static_cast<int>(x);
  const int iy = static_cast<int>(y);
  const float fx = x - static_cast<float>(ix);
  const float fy = y - static_cast<float>(iy);
  const float* p = image.row(iy) + ix - 1;
  const int w = image.width;
  using Row = Eigen::Map<const Eigen::Array4f>;
  const Eigen::Array4f above = Row(p - w);
  const Eigen::Array4f upper = Row(p);
  const Eigen::Array4f lower = Row(p + w);
  const Eigen::Array4f below = Row(p + 2 * w);
  const Eigen::Array4f value = upper + fy * (lower - upper);
  const Eigen::Array4f rise = lower - above;
  const Eigen::Array4f slope = rise + fy * ((below - upper) - rise);
  const float left = value[2] - value[0];
  const float right = value[3] - value[1];
  return {value[1] + fx * (value[2] - value[1]), 0.5F * (left + fx * (right - left)),
          0.5F * (slope[1] + fx * (slope[2] - slope[1]))};
}

// Bilinear value alone.
inline float sample_value(const Image& image, float x, float y) {
  const int ix = static_cast<int>(x);
  const int iy = static_cast<int>(y);
  const float fx = x - static_cast<float>(ix);
  const float fy = y - static_cast<float>(iy);
  const float* p = image.row(iy) + ix;
  const float top = p[0] + fx * (p[1] - p[0]);
  const float* q = p + image.width;
  const float bottom = q[0] + fx * (q[1] - q[0]);
  return top + fy * (bottom - top);
}

// The residual pattern: DSO's diamond without its centre instead of without one of its corners. Symmetric, because
// where one image is blurrier than the other (further away) what is left of a gradient is a ramp across the pattern,
// and a lopsided pattern takes that for a shift (measured: 0.1 px to one side at twice the distance).
inline constexpr int pattern_size = 8;
inline constexpr std::array<float, pattern_size> pattern_x{0, -1, 1, -2, 2, -1, 1, 0};
inline constexpr std::array<float, pattern_size> pattern_y{-2, -1, -1, 0, 0, 1, 1, 2};
using Pattern = Eigen::Array<float, pattern_size, 1>;

}  // namespace adit::thermal_odometry
