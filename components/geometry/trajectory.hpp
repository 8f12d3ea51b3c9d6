// Stamped poses and the TUM text format: one pose a line, "stamp[s] tx ty tz qx qy qz qw".
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "components/geometry/se3.hpp"
#include "idl/result.hpp"

namespace adit {

struct StampedPose {
  std::int64_t stamp_ns = 0;  // since the epoch of the recording's clock
  Pose pose = Pose::Identity();
};

// Poses of one frame in one other frame, stamps strictly increasing.
using Trajectory = std::vector<StampedPose>;

// Reads a TUM file. Empty lines and lines starting with '#' are skipped. Errors name file and line: a field that is not
// a finite number, a quaternion whose norm is not within 1 % of 1 (it is normalized), stamps that do not increase.
Result<Trajectory> read_tum(const std::string& path);

// One line of a TUM file, without line end. Stamps keep their nanoseconds, values 9 digits after the point.
std::string tum_line(const StampedPose& pose);

// Writes the whole file; fails with the system's reason.
Result<void> write_tum(const std::string& path, const Trajectory& trajectory);

// The pose at a time by constant-twist interpolation between its neighbours; nothing outside [first, last] stamp.
std::optional<Pose> interpolate(const Trajectory& trajectory, std::int64_t stamp_ns);

// Sum of the distances between consecutive positions [m].
double path_length(const Trajectory& trajectory);

}  // namespace adit
