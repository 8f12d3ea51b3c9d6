#include "bringup/evaluation/evaluation.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "bringup/evaluation/centre_line.hpp"

namespace adit::evaluation {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr double kMinDistance = 0.1;  // m: below this a percentage of the distance says nothing

double seconds(std::int64_t from_ns, std::int64_t to_ns) {
  return static_cast<double>(to_ns - from_ns) * 1e-9;
}

Result<void> check(const Trajectory& trajectory, const char* which) {
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    if (!trajectory[i].pose.matrix().allFinite()) {
      return Error{ErrorCode::malformed, std::string(which) + ": pose " + std::to_string(i) + " is not finite"};
    }
    if (i > 0 && trajectory[i].stamp_ns <= trajectory[i - 1].stamp_ns) {
      return Error{ErrorCode::malformed,
                   std::string(which) + ": the stamp of pose " + std::to_string(i) + " does not increase"};
    }
  }
  return {};
}

struct Pairs {
  std::vector<std::int64_t> stamps;
  std::vector<Pose> truth, estimate;
  void add(std::int64_t stamp, const Pose& t, const Pose& e) {
    stamps.push_back(stamp);
    truth.push_back(t);
    estimate.push_back(e);
  }
};

std::vector<StampedPose>::const_iterator first_not_before(const Trajectory& trajectory, std::int64_t stamp_ns) {
  return std::lower_bound(trajectory.begin(), trajectory.end(), stamp_ns,
                          [](const StampedPose& pose, std::int64_t stamp) { return pose.stamp_ns < stamp; });
}

const StampedPose& nearest(const Trajectory& trajectory, std::int64_t stamp_ns) {
  const auto after = first_not_before(trajectory, stamp_ns);
  if (after == trajectory.end()) return trajectory.back();
  if (after == trajectory.begin()) return trajectory.front();
  const auto before = std::prev(after);
  return stamp_ns - before->stamp_ns <= after->stamp_ns - stamp_ns ? *before : *after;
}

Pairs associate(const Trajectory& truth, const Trajectory& estimate, const Options& options) {
  Pairs pairs;
  for (const StampedPose& e : estimate) {
    const auto after = first_not_before(truth, e.stamp_ns);
    const bool inside = after != truth.end() && (after != truth.begin() || after->stamp_ns == e.stamp_ns);
    if (inside) {
      const bool dense = after->stamp_ns == e.stamp_ns ||
                         seconds(std::prev(after)->stamp_ns, after->stamp_ns) <= options.max_truth_gap_s;
      if (dense) {
        pairs.add(e.stamp_ns, *interpolate(truth, e.stamp_ns), e.pose);
        continue;
      }
    }
    // At the truth's ends and in its gaps: the estimate nearest to a truth pose stands for that pose.
    const StampedPose& t = nearest(truth, e.stamp_ns);
    const bool close = std::abs(seconds(t.stamp_ns, e.stamp_ns)) <= options.max_stamp_difference_s;
    if (close && &nearest(estimate, t.stamp_ns) == &e) pairs.add(e.stamp_ns, t.pose, e.pose);
  }
  return pairs;
}

Sample compare(std::int64_t stamp_ns, const Pose& truth, const Pose& estimate) {
  Sample s;
  s.stamp_ns = stamp_ns;
  s.truth = truth;
  s.estimate = estimate;
  const Eigen::Vector3d error = estimate.translation() - truth.translation();
  const double heading = yaw(truth.linear());
  s.position_error_m = error.norm();
  s.axial_error_m = std::cos(heading) * error.x() + std::sin(heading) * error.y();
  s.lateral_error_m = -std::sin(heading) * error.x() + std::cos(heading) * error.y();
  s.yaw_error_rad = wrap_angle(yaw(estimate.linear()) - heading);
  return s;
}

void split_along(const std::vector<Eigen::Vector2d>& centre_line, std::vector<Sample>& samples) {
  const CentreLine line(centre_line);
  for (Sample& s : samples) {
    const CentreLine::Split split = line.split(s.truth, s.estimate.translation());
    s.axial_error_m = split.axial_m;
    s.lateral_error_m = split.lateral_m;
  }
}

void position_statistics(Evaluation& result) {
  std::vector<double> errors;
  double sum = 0.0, squares = 0.0;
  for (const Sample& s : result.samples) {
    errors.push_back(s.position_error_m);
    sum += s.position_error_m;
    squares += s.position_error_m * s.position_error_m;
  }
  std::sort(errors.begin(), errors.end());
  const std::size_t n = errors.size();
  result.ate_rmse_m = std::sqrt(squares / static_cast<double>(n));
  result.ate_mean_m = sum / static_cast<double>(n);
  result.ate_median_m = n % 2 == 1 ? errors[n / 2] : 0.5 * (errors[n / 2 - 1] + errors[n / 2]);
  result.ate_max_m = errors.back();
}

// Geiger, Lenz, Urtasun, "Are we ready for autonomous driving?", CVPR 2012, eqs. (2)-(3), but divided by the path
// really driven instead of the nominal length: with poses metres apart the nominal length would flatter or punish.
std::optional<DriftByLength> drift_by_length(const std::vector<Sample>& samples, double length_m) {
  DriftByLength row;
  row.length_m = length_m;
  double squares = 0.0;
  std::size_t end = 0;
  for (std::size_t start = 0; start < samples.size(); ++start) {
    const double goal = samples[start].distance_m + length_m * (1.0 - 1e-12);
    while (end < samples.size() && samples[end].distance_m < goal) ++end;
    if (end == samples.size()) break;
    const double path = samples[end].distance_m - samples[start].distance_m;
    const Pose moved_truth = samples[start].truth.inverse() * samples[end].truth;
    const Pose moved_estimate = samples[start].estimate.inverse() * samples[end].estimate;
    const Pose error = moved_truth.inverse() * moved_estimate;
    row.translation_percent += 100.0 * error.translation().norm() / path;
    row.rotation_deg_per_m += kDegrees * so3_log(error.linear()).norm() / path;
    squares += error.translation().squaredNorm();
    ++row.segments;
  }
  if (row.segments == 0) return std::nullopt;
  const double n = static_cast<double>(row.segments);
  row.translation_percent /= n;
  row.rotation_deg_per_m /= n;
  row.translation_rmse_m = std::sqrt(squares / n);
  return row;
}

double median_period(const Trajectory& trajectory) {
  std::vector<double> periods;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    periods.push_back(seconds(trajectory[i - 1].stamp_ns, trajectory[i].stamp_ns));
  }
  if (periods.empty()) return 0.0;
  std::nth_element(periods.begin(), periods.begin() + static_cast<std::ptrdiff_t>(periods.size() / 2), periods.end());
  return periods[periods.size() / 2];
}

void coverage(const Trajectory& truth, const Trajectory& estimate, const Options& options, Evaluation& result) {
  const std::int64_t begin = truth.front().stamp_ns;
  const std::int64_t end = truth.back().stamp_ns;
  const double limit = options.max_estimate_gap_s > 0.0 ? options.max_estimate_gap_s : 3.0 * median_period(estimate);
  double covered = 0.0;
  std::int64_t previous = begin;
  bool started = false;
  for (const StampedPose& e : estimate) {
    const std::int64_t stamp = std::clamp(e.stamp_ns, begin, end);
    const double gap = seconds(previous, stamp);
    result.largest_gap_s = std::max(result.largest_gap_s, gap);
    if (started && gap <= limit) covered += gap;
    started = true;
    previous = stamp;
  }
  result.largest_gap_s = std::max(result.largest_gap_s, seconds(previous, end));
  result.availability = covered / seconds(begin, end);
}

}  // namespace

Evaluation nothing_delivered(const std::string& name, const Trajectory& truth) {
  Evaluation result;
  result.name = name;
  result.truth_distance_m = path_length(truth);
  if (!truth.empty()) result.truth_duration_s = seconds(truth.front().stamp_ns, truth.back().stamp_ns);
  result.largest_gap_s = result.truth_duration_s;
  return result;
}

Result<Evaluation> evaluate(const Trajectory& truth, const Trajectory& estimate, const Options& options) {
  if (truth.size() < 2) {
    return Error{ErrorCode::invalid_argument,
                 "truth: " + std::to_string(truth.size()) + " poses, an evaluation needs at least 2"};
  }
  if (Result<void> ok = check(truth, "truth"); !ok) return ok.error();
  if (Result<void> ok = check(estimate, "estimate"); !ok) return ok.error();
  if (estimate.empty()) return Error{ErrorCode::invalid_argument, "estimate: no poses"};

  const Pairs pairs = associate(truth, estimate, options);
  if (pairs.stamps.empty()) {
    return Error{ErrorCode::invalid_argument,
                 "no common instant: truth covers " + tum_line(truth.front()).substr(0, 20) + " to " +
                     tum_line(truth.back()).substr(0, 20) + ", the estimate " +
                     tum_line(estimate.front()).substr(0, 20) + " to " + tum_line(estimate.back()).substr(0, 20) +
                     " (same clock? gaps in the truth above max_truth_gap_s?)"};
  }
  const Result<Similarity> alignment = align(pairs.truth, pairs.estimate, options.alignment, options.yaw_only);
  if (!alignment) return alignment.error();
  const Similarity start = *align(pairs.truth, pairs.estimate, Alignment::first_pose, options.yaw_only);

  Evaluation result = nothing_delivered("", truth);
  result.largest_gap_s = 0.0;
  result.alignment_yaw_rad = yaw(start.rotation);
  result.frames = pairs.stamps.size();
  for (std::size_t i = 0; i < pairs.stamps.size(); ++i) {
    Sample s = compare(pairs.stamps[i], pairs.truth[i], alignment->apply(pairs.estimate[i]));
    if (i > 0) {
      result.distance_m += (pairs.truth[i].translation() - pairs.truth[i - 1].translation()).norm();
      s.distance_m = result.distance_m;
    }
    const Pose from_start = start.apply(pairs.estimate[i]);
    s.start_aligned = from_start.translation();
    s.start_yaw_error_rad = wrap_angle(yaw(from_start.linear()) - yaw(s.truth.linear()));
    result.samples.push_back(s);
  }
  if (!options.centre_line.empty()) split_along(options.centre_line, result.samples);
  position_statistics(result);
  coverage(truth, estimate, options, result);
  if (pairs.stamps.size() >= 2) {
    const Sample end = compare(pairs.stamps.back(), pairs.truth.back(), start.apply(pairs.estimate.back()));
    result.yaw_end_deg = kDegrees * std::abs(end.yaw_error_rad);
    result.axial_end_m = end.axial_error_m;
    result.lateral_end_m = end.lateral_error_m;
    if (!options.centre_line.empty()) {
      const CentreLine line(options.centre_line);
      const CentreLine::Split split = line.split(end.truth, end.estimate.translation());
      result.axial_end_m = split.axial_m;
      result.lateral_end_m = split.lateral_m;
    }
    if (result.distance_m >= kMinDistance) result.drift_percent = 100.0 * end.position_error_m / result.distance_m;
    result.scale = similarity_scale(pairs.truth, pairs.estimate);
  }
  for (const double length : options.lengths_m) {
    if (!(length > 0.0)) return Error{ErrorCode::invalid_argument, "drift lengths must be positive"};
    if (const auto row = drift_by_length(result.samples, length)) result.drift.push_back(*row);
  }
  if (const auto row = drift_by_length(result.samples, 10.0)) result.rpe_10m_percent = row->translation_percent;
  return result;
}

}  // namespace adit::evaluation
