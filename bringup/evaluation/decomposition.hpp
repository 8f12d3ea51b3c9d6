// Where a position error comes from: from a wrong heading, from a wrong scale of the speed, or from the rest
// (arXiv 2505.03565 says of its experiment that the yaw drift is the cause; this measures it).
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "bringup/evaluation/evaluation.hpp"

namespace adit::evaluation {

struct ErrorParts {
  double total_m = 0.0;  // horizontal position error, start aligned
  double yaw_m = 0.0;    // goes away when every step is turned by the heading error of its instant
  double scale_m = 0.0;  // goes away when the steps so turned are also scaled by one factor for the whole way
  double rest_m = 0.0;   // what then remains
};

struct Decomposition {
  ErrorParts end, rms;
  double yaw_share = 0.0;          // 1 - |error with the true heading| / |error|, at the end; 0 when there is no error
  double speed_scale = 1.0;        // the factor: true length / estimated length
  std::vector<ErrorParts> series;  // one a sample
};

// Integrates the estimate's steps anew with the truth's heading, then with the scale that fits the way best.
Decomposition decompose(const std::vector<Sample>& samples);

}  // namespace adit::evaluation
