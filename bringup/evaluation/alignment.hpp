// The transform that brings an estimated trajectory into the truth's frame.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "components/geometry/se3.hpp"
#include "idl/result.hpp"

namespace adit::evaluation {

enum class Alignment {
  none,        // the frames are the same
  first_pose,  // the first common pose: what a vehicle experiences (evo: --align_origin)
  se3,         // least squares over all positions (evo: -a)
  sim3,        // least squares with scale (evo: -as)
};

// "none", "first_pose", "se3", "sim3".
Result<Alignment> parse_alignment(const std::string& name);
std::string to_string(Alignment alignment);

// x_truth = scale * rotation * x_estimate + translation.
struct Similarity {
  double scale = 1.0;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Pose apply(const Pose& pose) const;
};

// The similarity for two pose lists of equal, non-zero length. `yaw_only` restricts the rotation to the vertical axis
// (4 degrees of freedom, for estimates that know gravity). Least squares after S. Umeyama, "Least-squares estimation of
// transformation parameters between two point patterns", PAMI 13(4), 1991, eqs. (40)-(42). Directions the positions
// leave open (a straight or a standing trajectory) are taken from the orientations. Error: sim3 of an estimate that
// stands still.
Result<Similarity> align(std::span<const Pose> truth, std::span<const Pose> estimate, Alignment alignment,
                         bool yaw_only);

// The Sim(3) scale alone; nothing when one of the two stands still (spread below 1 mm).
std::optional<double> similarity_scale(std::span<const Pose> truth, std::span<const Pose> estimate);

}  // namespace adit::evaluation
