#include "components/geometry/trajectory.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>

namespace adit {
namespace {

std::optional<double> parse_number(const std::string& text) {
  double value = 0.0;
  const auto [rest, bad] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (bad != std::errc{} || rest != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

// "1582229001.123456789" to nanoseconds without going through a double, which keeps only 100 ns at such times.
std::optional<std::int64_t> parse_stamp(const std::string& text) {
  const char* const end = text.data() + text.size();
  std::int64_t seconds = 0;
  const auto [point, bad] = std::from_chars(text.data(), end, seconds);
  const bool plain = bad == std::errc{} && std::abs(seconds) < 9'000'000'000 && (point == end || *point == '.') &&
                     std::all_of(point == end ? end : point + 1, end, [](char c) { return c >= '0' && c <= '9'; });
  if (!plain) {  // 1.58222900e+09 and the like
    const std::optional<double> value = parse_number(text);
    if (!value || std::abs(*value) > 9e9) return std::nullopt;
    return static_cast<std::int64_t>(std::llround(*value * 1e9));
  }
  std::int64_t nanoseconds = 0;
  std::int64_t digit = 100'000'000;
  for (const char* c = point; c != end && ++c != end; digit /= 10) nanoseconds += (*c - '0') * digit;
  return seconds * 1'000'000'000 + (text.front() == '-' ? -nanoseconds : nanoseconds);
}

}  // namespace

Result<Trajectory> read_tum(const std::string& path) {
  std::ifstream file(path);
  if (!file) return Error{ErrorCode::not_found, path + ": cannot open: " + std::strerror(errno)};
  Trajectory trajectory;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    std::istringstream fields(line);
    std::string field;
    if (!(fields >> field) || field.front() == '#') continue;
    const auto bad = [&](const std::string& why) {
      return Error{ErrorCode::malformed, path + ":" + std::to_string(number) + ": " + why};
    };
    const std::optional<std::int64_t> stamp = parse_stamp(field);
    if (!stamp) return bad("'" + field + "' is not a time in seconds");
    double value[7];
    for (double& v : value) {
      if (!(fields >> field)) return bad("expected 8 columns: stamp tx ty tz qx qy qz qw");
      const std::optional<double> number_read = parse_number(field);
      if (!number_read) return bad("'" + field + "' is not a finite number");
      v = *number_read;
    }
    if (fields >> field) return bad("more than 8 columns");
    const Eigen::Quaterniond q(value[6], value[3], value[4], value[5]);
    if (std::abs(q.norm() - 1.0) > 0.01) return bad("the quaternion's norm is " + std::to_string(q.norm()) + ", not 1");
    if (!trajectory.empty() && *stamp <= trajectory.back().stamp_ns) return bad("the stamp does not increase");
    StampedPose pose;
    pose.stamp_ns = *stamp;
    pose.pose.linear() = q.normalized().toRotationMatrix();
    pose.pose.translation() = Eigen::Vector3d(value[0], value[1], value[2]);
    trajectory.push_back(pose);
  }
  return trajectory;
}

std::string tum_line(const StampedPose& stamped) {
  Eigen::Quaterniond q(stamped.pose.linear());
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  const Eigen::Vector3d t = stamped.pose.translation();
  const bool negative = stamped.stamp_ns < 0;
  const std::uint64_t stamp =
      negative ? 0 - static_cast<std::uint64_t>(stamped.stamp_ns) : static_cast<std::uint64_t>(stamped.stamp_ns);
  char text[256];
  std::snprintf(text, sizeof text, "%s%llu.%09llu %.9f %.9f %.9f %.9f %.9f %.9f %.9f", negative ? "-" : "",
                static_cast<unsigned long long>(stamp / 1'000'000'000),
                static_cast<unsigned long long>(stamp % 1'000'000'000), t.x(), t.y(), t.z(), q.x(), q.y(), q.z(),
                q.w());
  return text;
}

Result<void> write_tum(const std::string& path, const Trajectory& trajectory) {
  std::ofstream file(path);
  for (const StampedPose& pose : trajectory) file << tum_line(pose) << '\n';
  file.flush();
  if (!file) return Error{ErrorCode::io, path + ": cannot write: " + std::strerror(errno)};
  return {};
}

std::optional<Pose> interpolate(const Trajectory& trajectory, std::int64_t stamp_ns) {
  const auto after =
      std::lower_bound(trajectory.begin(), trajectory.end(), stamp_ns,
                       [](const StampedPose& pose, std::int64_t stamp) { return pose.stamp_ns < stamp; });
  if (after == trajectory.end()) return std::nullopt;
  if (after->stamp_ns == stamp_ns) return after->pose;
  if (after == trajectory.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const double fraction =
      static_cast<double>(stamp_ns - before->stamp_ns) / static_cast<double>(after->stamp_ns - before->stamp_ns);
  return se3_interpolate(before->pose, after->pose, fraction);
}

double path_length(const Trajectory& trajectory) {
  double length = 0.0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    length += (trajectory[i].pose.translation() - trajectory[i - 1].pose.translation()).norm();
  }
  return length;
}

}  // namespace adit
