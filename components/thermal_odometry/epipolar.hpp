// Depth of a pixel from keyframes with known poses: search along the epipolar lines of several of them at once, then
// Gauss-Newton (paper R26; Engel et al., DSO, 2018, section 3.3, done backwards in time: moving forward, all of a new
// view has been seen before, so a point can be born with a depth instead of waiting for one).
#pragma once

#include <optional>
#include <span>

#include "components/thermal_odometry/tracker.hpp"
#include "components/thermal_odometry/warp.hpp"

namespace adit::thermal_odometry {

struct DepthRange {
  float min_inverse;
  float max_inverse;
};

struct EpipolarConfig {
  float max_cost = 3.5F;   // mean squared residual over sigma^2, best match
  float min_ratio = 1.2F;  // of the second best match to the best
  float max_relative_sigma = 0.12F;
  float min_parallax = 1.5F;  // px between the ends of the range, in the best view
  int max_steps = 60;
  double correlation = 3.0;  // of the residuals within a patch
};

// `patch`: pixel of the newest view `host`; `sigma`: scale of the residuals [noise units]. Gives inverse depth and its
// standard deviation in the returned patch; nothing if no match is clear.
std::optional<Patch> search_depth(const Patch& patch, const ReferenceView& host, std::span<const ReferenceView> views,
                                  const Pinhole& camera, const DepthRange& range, float sigma,
                                  const EpipolarConfig& config);

}  // namespace adit::thermal_odometry
