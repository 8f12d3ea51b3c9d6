#include "components/thermal_odometry/cloud_buffer.hpp"

#include <algorithm>

namespace adit::thermal_odometry {
namespace {
constexpr std::int64_t max_extrapolation_ns = 200'000'000;
constexpr std::int64_t max_newer_ns = 50'000'000;
constexpr std::int64_t max_cubic_ns = 250'000'000;  // that four poses may span
constexpr int bins = 16;                            // poses across the duration of a cloud
}  // namespace

void PoseHistory::add(std::int64_t stamp_ns, const Pose& T_cw) {
  ring_[next_] = {stamp_ns, T_cw};
  next_ = (next_ + 1) % ring_.size();
  count_ = std::min(count_ + 1, ring_.size());
}

std::optional<Pose> PoseHistory::at(std::int64_t stamp_ns) const {
  if (count_ == 0) return std::nullopt;
  if (stamp_ns >= entry(0).stamp_ns) {
    if (stamp_ns - entry(0).stamp_ns > max_extrapolation_ns) return std::nullopt;
    if (count_ == 1 || stamp_ns == entry(0).stamp_ns) return entry(0).T_cw;
    const double span = static_cast<double>(entry(0).stamp_ns - entry(1).stamp_ns);
    return se3_interpolate(entry(1).T_cw, entry(0).T_cw, static_cast<double>(stamp_ns - entry(1).stamp_ns) / span);
  }
  for (std::size_t age = 1; age < count_; ++age) {
    const Entry& before = entry(age);
    if (before.stamp_ns > stamp_ns) continue;
    return curved(stamp_ns, age);
  }
  return std::nullopt;
}

// Between entry(age) and the next newer one: the cubic through four poses about them in the tangent space of one (what
// shakes a body, a gait of 5 Hz, is not straight between frames), or a straight line where there are no four.
Pose PoseHistory::curved(std::int64_t stamp_ns, std::size_t age) const {
  const Entry& before = entry(age);
  const Entry& after = entry(age - 1);
  const std::size_t newest = age >= 2 ? age - 2 : 0;
  if (newest + 3 >= count_ || entry(newest).stamp_ns - entry(newest + 3).stamp_ns > max_cubic_ns) {
    return se3_interpolate(
        before.T_cw, after.T_cw,
        static_cast<double>(stamp_ns - before.stamp_ns) / static_cast<double>(after.stamp_ns - before.stamp_ns));
  }
  const auto at = [&](std::size_t k) { return static_cast<double>(entry(newest + k).stamp_ns - before.stamp_ns); };
  const auto t = static_cast<double>(stamp_ns - before.stamp_ns);
  const Pose T_wb = before.T_cw.inverse();
  Vector6d x = Vector6d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    double weight = 1.0;  // Lagrange
    for (std::size_t j = 0; j < 4; ++j) {
      if (j != i) weight *= (t - at(j)) / (at(i) - at(j));
    }
    x += weight * se3_log(entry(newest + i).T_cw * T_wb);
  }
  return se3_exp(x) * before.T_cw;
}

CloudBuffer::CloudBuffer(std::size_t capacity, double max_age_s) : capacity_(capacity), max_age_s_(max_age_s) {
  for (Cloud& cloud : clouds_) {
    cloud.points.reserve(capacity);
    cloud.offsets_s.reserve(capacity);
  }
  moved_.reserve(capacity);
}

void CloudBuffer::add(const DepthPoints& cloud) {
  if (cloud.points.empty() || !cloud.T_camera_sensor.matrix().allFinite()) return;
  const bool timed = cloud.time_offsets_s.size() == cloud.points.size();
  if (!timed && !cloud.time_offsets_s.empty()) return;
  Cloud& target = clouds_[next_];
  next_ = (next_ + 1) % clouds_.size();
  target.stamp_ns = cloud.stamp_ns;
  target.used = true;
  target.points.clear();
  target.offsets_s.clear();
  target.first_offset_s = target.last_offset_s = 0.0F;
  const Eigen::Isometry3f T = cloud.T_camera_sensor.cast<float>();
  const std::size_t step = (cloud.points.size() + capacity_ - 1) / capacity_;
  for (std::size_t i = 0; i < cloud.points.size(); i += step) {
    const float offset = timed ? cloud.time_offsets_s[i] : 0.0F;
    if (!cloud.points[i].allFinite() || !(std::abs(offset) < 1.0F)) continue;
    if (target.points.empty()) target.first_offset_s = target.last_offset_s = offset;
    target.first_offset_s = std::min(target.first_offset_s, offset);
    target.last_offset_s = std::max(target.last_offset_s, offset);
    target.points.emplace_back(T * cloud.points[i]);
    target.offsets_s.push_back(offset);
  }
}

std::span<const Eigen::Vector3f> CloudBuffer::at(std::int64_t stamp_ns, const PoseHistory& history,
                                                 const Eigen::Matrix3d& boresight) {
  moved_.clear();
  const Cloud* best = nullptr;
  const auto max_age_ns = static_cast<std::int64_t>(1e9 * max_age_s_);
  for (const Cloud& cloud : clouds_) {
    if (!cloud.used) continue;
    const std::int64_t age =
        stamp_ns - cloud.stamp_ns - static_cast<std::int64_t>(1e9 * static_cast<double>(cloud.last_offset_s));
    const bool fits = age >= -max_newer_ns && age <= max_age_ns;
    if (fits && (best == nullptr || cloud.stamp_ns > best->stamp_ns)) best = &cloud;
  }
  if (best == nullptr) return {};
  std::array<Eigen::Isometry3f, bins> motion;
  motion.fill(Eigen::Isometry3f(boresight.cast<float>()));
  const float span_s = best->last_offset_s - best->first_offset_s;
  if (const std::optional<Pose> now = history.at(stamp_ns)) {
    for (int i = 0; i < bins; ++i) {
      const float offset = best->first_offset_s + span_s * static_cast<float>(i) / (bins - 1);
      const std::optional<Pose> then =
          history.at(best->stamp_ns + static_cast<std::int64_t>(1e9 * static_cast<double>(offset)));
      if (then) motion[static_cast<std::size_t>(i)] = (*now * then->inverse() * Pose(boresight)).cast<float>();
    }
  }
  for (std::size_t i = 0; i < best->points.size(); ++i) {
    const float fraction = span_s > 0.0F ? (best->offsets_s[i] - best->first_offset_s) / span_s : 0.0F;
    moved_.emplace_back(motion[static_cast<std::size_t>(fraction * (bins - 1) + 0.5F)] * best->points[i]);
  }
  return moved_;
}

}  // namespace adit::thermal_odometry
