// Corners of a thermal image and their ORB descriptors (Rublee et al., ICCV 2011), for recognizing places.
#pragma once

#include <vector>

#include "components/thermal_odometry/place_index.hpp"
#include "components/thermal_odometry/pyramid.hpp"

namespace adit::thermal_odometry {

struct Corner {
  float u = 0.0F;  // px
  float v = 0.0F;
  float depth = 0.0F;  // m along the optical axis; 0: not known
};

struct CornerConfig {
  int cell = 40;           // px
  int corners_a_cell = 3;  // the strongest ones: corners all over the image, about 400 of 640 x 512
  int levels = 3;          // of ORB's pyramid, 1.2 from one to the next
  int fast_threshold = 7;  // of 256 grey levels between the image's 0.5 % and 99.5 %
};

// Same order in both; depths are left at 0. `image` in any unit: the descriptors compare pixels, so that the copy of 8
// bits they are taken from, which is used for nothing else, costs nothing.
void detect_corners(const Image& image, const CornerConfig& config, std::vector<Corner>& corners,
                    std::vector<Descriptor>& descriptors);

}  // namespace adit::thermal_odometry
