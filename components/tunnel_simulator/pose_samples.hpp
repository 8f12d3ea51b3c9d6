// Poses of a smooth motion at many equal steps, from few evaluations of it.
#pragma once

#include <functional>
#include <span>

#include "components/geometry/se3.hpp"

namespace adit::tunnel_simulator {

// out[i] = pose(begin + i * step). The motion is evaluated at knots of at most `knot` seconds and interpolated in
// between by cubic polynomials in the tangent space of the knot before (four knots each): with knots of 2 ms the error
// of a walking robot's motion is below a nanometre.
void sample_poses(const std::function<Pose(double)>& pose, double begin, double step, double knot, std::span<Pose> out);

}  // namespace adit::tunnel_simulator
