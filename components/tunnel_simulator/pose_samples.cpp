#include "components/tunnel_simulator/pose_samples.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace adit::tunnel_simulator {

void sample_poses(const std::function<Pose(double)>& pose, double begin, double step, double knot,
                  std::span<Pose> out) {
  const auto stride = static_cast<std::size_t>(std::max(1.0, std::floor(knot / std::max(step, 1e-9))));
  if (stride < 4 || step <= 0.0) {
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = pose(begin + step * static_cast<double>(i));
    return;
  }
  const double spacing = step * static_cast<double>(stride);
  std::array<Pose, 4> knots{pose(begin - spacing), pose(begin), pose(begin + spacing), pose(begin + 2.0 * spacing)};
  for (std::size_t first = 0; first < out.size(); first += stride) {
    // Tangents at knots -1, 1, 2 seen from knot 0, where the tangent is 0.
    const Pose back = knots[1].inverse();
    const Vector6d before = se3_log(back * knots[0]);
    const Vector6d next = se3_log(back * knots[2]);
    const Vector6d after = se3_log(back * knots[3]);
    for (std::size_t i = first; i < std::min(out.size(), first + stride); ++i) {
      const double t = static_cast<double>(i - first) / static_cast<double>(stride);
      const double w_before = -t * (t - 1.0) * (t - 2.0) / 6.0;
      const double w_next = -(t + 1.0) * t * (t - 2.0) / 2.0;
      const double w_after = (t + 1.0) * t * (t - 1.0) / 6.0;
      out[i] = knots[1] * se3_exp(w_before * before + w_next * next + w_after * after);
    }
    std::rotate(knots.begin(), knots.begin() + 1, knots.end());
    const auto reached = static_cast<double>(first / stride + 3);
    if (first + stride < out.size()) knots[3] = pose(begin + spacing * reached);
  }
}

}  // namespace adit::tunnel_simulator
