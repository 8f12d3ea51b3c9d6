#pragma once

#include <array>
#include <span>
#include <string_view>

#include "components/geometry/se3.hpp"
#include "idl/result.hpp"

namespace adit {

// Finite, a rotation to within single precision, and no farther than 10 000 km: what may be taken for a pose.
bool is_rigid(const Pose& pose);

// A pose as parameters and command lines have it: x y z [m], quaternion x y z w.
// Errors begin with `name`: not seven numbers, not finite, or a quaternion whose norm is 1 % or more off.
Result<Pose> pose_from_numbers(std::span<const double> numbers, std::string_view name);
std::array<double, 7> numbers_of(const Pose& pose);

}  // namespace adit
