#include "components/thermal_odometry/points_picture.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "components/thermal_odometry/camera.hpp"

namespace adit::thermal_odometry {
namespace {

using Colour = std::array<std::uint8_t, 3>;

// Red, yellow, green, cyan, blue over [0, 1].
Colour rainbow(float t) {
  const float x = 4.0F * std::clamp(t, 0.0F, 1.0F);
  const auto channel = [x](float centre, float half) {
    return static_cast<std::uint8_t>(255.0F * std::clamp(half - std::abs(x - centre), 0.0F, 1.0F));
  };
  return {channel(0.0F, 2.0F), channel(2.0F, 2.0F), channel(4.0F, 2.0F)};
}

}  // namespace

void draw_points(const Frame& frame, const CameraModel& camera, std::span<const MapPoint> points,
                 const DepthColours& colours, std::span<std::uint8_t> rgb, std::vector<std::uint16_t>& scratch) {
  const int stride = frame.stride > 0 ? frame.stride : frame.width;
  const auto count_at = [&](int x, int y) { return frame.data[static_cast<std::ptrdiff_t>(y) * stride + x]; };
  scratch.clear();
  for (int y = 0; y < frame.height; y += 4) {
    for (int x = 0; x < frame.width; x += 4) scratch.push_back(count_at(x, y));
  }
  std::sort(scratch.begin(), scratch.end());
  const auto low = static_cast<float>(scratch[scratch.size() / 100]);
  const auto high = static_cast<float>(scratch[scratch.size() - 1 - scratch.size() / 100]);
  const float scale = 255.0F / std::max(1.0F, high - low);
  std::size_t i = 0;
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x, i += 3) {
      const float grey = std::clamp((static_cast<float>(count_at(x, y)) - low) * scale, 0.0F, 255.0F);
      rgb[i] = rgb[i + 1] = rgb[i + 2] = static_cast<std::uint8_t>(grey);
    }
  }
  const float range = std::log(std::max(1.001F, colours.far / colours.near));
  for (const MapPoint& point : points) {
    const Eigen::Vector2d ideal((static_cast<double>(point.u) - camera.cx) / camera.fx,
                                (static_cast<double>(point.v) - camera.cy) / camera.fy);
    const Eigen::Vector2d pixel = distort(camera, ideal);
    if (!pixel.allFinite() || pixel.cwiseAbs().maxCoeff() > 1e6 || !(point.depth > 0.0F)) continue;
    const Colour colour = rainbow(std::log(point.depth / colours.near) / range);
    const int radius = point.anchored ? 2 : 1;
    const auto u = static_cast<int>(std::lround(pixel.x()));
    const auto v = static_cast<int>(std::lround(pixel.y()));
    for (int y = std::max(0, v - radius); y <= std::min(frame.height - 1, v + radius); ++y) {
      for (int x = std::max(0, u - radius); x <= std::min(frame.width - 1, u + radius); ++x) {
        const auto at =
            3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width) + static_cast<std::size_t>(x));
        std::copy(colour.begin(), colour.end(), rgb.begin() + static_cast<std::ptrdiff_t>(at));
      }
    }
  }
}

}  // namespace adit::thermal_odometry
