#include "components/mapping/cloud.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace adit::mapping {
namespace {

constexpr std::size_t knots = 16;  // of the motion within a sweep: 6 ms apart at 10 Hz

std::pair<float, float> time_span(const Sweep& sweep) {
  float first = 0.0F, last = 0.0F;
  for (const float t : sweep.seconds) {
    if (!std::isfinite(t)) continue;
    first = std::min(first, t);
    last = std::max(last, t);
  }
  return {first, last};
}

std::int64_t at(const Sweep& sweep, double seconds) {
  return sweep.stamp_ns + static_cast<std::int64_t>(std::llround(1e9 * seconds));
}

}  // namespace

std::int64_t end_ns(const Sweep& sweep) {
  return at(sweep, time_span(sweep).second);
}

std::size_t odd_stride(std::size_t size, std::size_t most) {
  return (size / std::max<std::size_t>(1, most)) | 1U;
}

std::optional<Pose> pose_at(const Trajectory& poses, std::int64_t stamp_ns) {
  if (poses.empty()) return std::nullopt;
  const std::int64_t nearest = std::clamp(stamp_ns, poses.front().stamp_ns, poses.back().stamp_ns);
  if (std::abs(nearest - stamp_ns) > instant_tolerance_ns) return std::nullopt;
  return interpolate(poses, nearest);
}

bool undistort(const Sweep& sweep, const Trajectory& poses, const Pose& reference, const Undistortion& config,
               Points& out, std::size_t& invalid) {
  out.clear();
  if (!sweep.seconds.empty() && sweep.seconds.size() != sweep.points.size()) return false;
  const auto [first, last] = time_span(sweep);
  const float period = std::max(last - first, 1e-9F);
  std::array<Eigen::Isometry3f, knots> motion;
  const Pose back = reference.inverse();
  for (std::size_t i = 0; i < knots; ++i) {
    const double t = first + (last - first) * static_cast<double>(i) / (knots - 1);
    const std::optional<Pose> pose = pose_at(poses, at(sweep, t));
    if (!pose) return false;
    motion[i] = (back * *pose).cast<float>();
  }
  const auto least = static_cast<float>(config.min_range * config.min_range);
  const auto most = static_cast<float>(config.max_range * config.max_range);
  const std::size_t stride = odd_stride(sweep.points.size(), config.most_points);
  for (std::size_t i = 0; i < sweep.points.size(); i += stride) {
    const Point& point = sweep.points[i];
    const float t = sweep.seconds.empty() ? 0.0F : sweep.seconds[i];
    const float r2 = point.position.squaredNorm();
    if (!std::isfinite(r2) || !std::isfinite(t) || r2 == 0.0F) {
      ++invalid;
      continue;
    }
    if (r2 <= least || r2 >= most) continue;
    const auto knot = static_cast<std::size_t>((t - first) / period * (knots - 1) + 0.5F);
    const float intensity = std::isfinite(point.intensity) ? point.intensity : 0.0F;
    out.push_back({motion[std::min(knot, knots - 1)] * point.position, intensity});
  }
  return true;
}

}  // namespace adit::mapping
