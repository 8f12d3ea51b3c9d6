// The exponential response of microbolometer pixels: what a pixel showed a moment ago is now where the image motion has
// carried it, so that each pixel is the mean along a trail behind it.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "components/geometry/se3.hpp"
#include "components/tunnel_simulator/camera_model.hpp"

namespace adit::tunnel_simulator {

class PixelLag {
 public:
  // The rays of all pixels, row by row: x / z and y / z, and z of the unit ray.
  struct Rays {
    std::span<const float> plane_x, plane_y, z;
  };
  // time_constant, row_time [s].
  PixelLag(const CameraModel& camera, double time_constant, double row_time);

  // The frame whose first row is read at `time` by a camera that moves like `pose` (world <- optical frame).
  void begin(const std::function<Pose(double)>& pose, double time);
  // One row of `out` from the whole image without lag. range [m]: 0 where nothing was hit. Rows may be taken by several
  // threads at once.
  void apply(int row, const Rays& rays, std::span<const float> range, std::span<const float> image,
             std::span<float> out) const;

 private:
  CameraModel camera_;
  double time_constant_;
  double row_time_;
  std::vector<Pose> now_, young_, old_;  // of the camera as each row is read, and before
};

}  // namespace adit::tunnel_simulator
