// Is an estimator as uncertain as it is wrong? NEES after Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to
// Tracking and Navigation", 2001, section 5.4.2, of the planar pose (x, y, yaw): 3 degrees of freedom.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bringup/evaluation/evaluation.hpp"

namespace adit::evaluation {

// Covariance of (x, y, yaw) [m, m, rad] in the estimate's own frame, accumulated since its start.
struct StampedCovariance {
  std::int64_t stamp_ns = 0;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

// Reads what trajectory_writer writes with `covariance`: "stamp xx xy xa yy ya aa". Errors name file and line.
Result<std::vector<StampedCovariance>> read_covariances(const std::string& path);

// Fills nees_mean, sigma3_coverage and the series of `evaluation`. Samples without a covariance of exactly their stamp,
// or with a singular one, are left out; without any the figures stay empty. Errors are those of the first-pose
// alignment: a covariance speaks of the motion since the start.
void add_consistency(std::span<const StampedCovariance> covariances, Evaluation& evaluation);

}  // namespace adit::evaluation
