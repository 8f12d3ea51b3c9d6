#pragma once

#include "components/geometry/se3.hpp"

namespace adit {

// Finite, a rotation to within single precision, and no farther than 10 000 km: what may be taken for a pose.
bool is_rigid(const Pose& pose);

}  // namespace adit
