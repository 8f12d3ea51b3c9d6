#include "components/lidar_odometry/test_data.hpp"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <numbers>
#include <sstream>

namespace adit::lidar_odometry {

Cloud RecordedSweep::cloud() const {
  Cloud cloud;
  cloud.stamp_ns = stamp_ns;
  cloud.points = std::span<const Point3f>(points);
  cloud.seconds = std::span<const float>(seconds);
  cloud.rings = std::span<const std::uint16_t>(rings);
  cloud.width = width;
  cloud.height = height;
  return cloud;
}

std::optional<std::string> shared_data(const std::string& name) {
  const char* given = std::getenv("ADIT_SHARED");
  const std::filesystem::path shared = given != nullptr ? given : ADIT_SOURCE_DIR "/../shared";
  const std::filesystem::path folder = shared / "data" / name;
  if (!std::filesystem::exists(folder)) return std::nullopt;
  return folder.string();
}

namespace {

std::vector<char> read_bytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// In pieces: a whole file would be a fifth of the memory that a process of the odometry takes.
RecordedSweep read_sweep(const std::string& path, std::size_t count) {
  std::error_code error;
  const auto size = static_cast<std::size_t>(std::filesystem::file_size(path, error));
  const std::size_t columns = error ? 0 : count > 0 ? size / (4 * count) : 4;
  RecordedSweep sweep;
  if (columns < 3) return sweep;
  const std::size_t points = size / (4 * columns);
  sweep.points.reserve(points);
  sweep.seconds.reserve(columns >= 5 ? points : 0);
  sweep.rings.reserve(columns >= 6 ? points : 0);
  std::ifstream file(path, std::ios::binary);
  std::vector<float> record(columns);
  while (file.read(reinterpret_cast<char*>(record.data()), static_cast<std::streamsize>(4 * columns))) {
    sweep.points.emplace_back(record[0], record[1], record[2]);
    if (columns >= 5) sweep.seconds.push_back(record[4]);
    if (columns >= 6) sweep.rings.push_back(static_cast<std::uint16_t>(record[5]));
  }
  return sweep;
}

}  // namespace

SweepReader::SweepReader(const std::string& folder, std::int64_t stamp_unit_ns)
    : folder_(folder), stamp_unit_ns_(stamp_unit_ns), index_(folder + "/scans/index.txt") {}

std::optional<RecordedSweep> SweepReader::next() {
  for (std::string line; std::getline(index_, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    std::string name;
    std::int64_t stamp = 0;
    std::size_t points = 0;
    fields >> name;
    if (stamp_unit_ns_ > 0) fields >> stamp;
    fields >> points;
    RecordedSweep sweep = read_sweep(folder_ + "/scans/" + name, points);
    sweep.stamp_ns = stamp_unit_ns_ > 0 ? stamp * stamp_unit_ns_ : count_ * 100'000'000;
    ++count_;
    return sweep;
  }
  return std::nullopt;
}

std::vector<RecordedSweep> read_sweeps(const std::string& folder, std::int64_t stamp_unit_ns) {
  std::vector<RecordedSweep> sweeps;
  SweepReader reader(folder, stamp_unit_ns);
  while (std::optional<RecordedSweep> sweep = reader.next()) sweeps.push_back(*std::move(sweep));
  return sweeps;
}

std::vector<Point3f> read_ply(const std::string& path) {
  const std::vector<char> bytes = read_bytes(path);
  const std::string_view text(bytes.data(), bytes.size());
  const std::string_view end = "end_header\n";
  const std::size_t body = text.find(end);
  std::vector<Point3f> points;
  if (body == std::string_view::npos) return points;
  for (std::size_t i = body + end.size(); i + 16 <= bytes.size(); i += 16) {
    Point3f point;
    std::memcpy(point.data(), &bytes[i], 12);
    points.push_back(point);
  }
  return points;
}

double resident_megabytes() {
  std::ifstream file("/proc/self/statm");
  double total = 0.0, resident = 0.0;
  file >> total >> resident;
  return resident * 4096.0 / 1048576.0;
}

TrajectoryError trajectory_error(const std::vector<Pose>& truth, const std::vector<Pose>& estimate) {
  TrajectoryError error;
  const Eigen::Index n = static_cast<Eigen::Index>(truth.size());
  Eigen::Matrix3Xd a(3, n), b(3, n);
  double length = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    a.col(i) = estimate[static_cast<std::size_t>(i)].translation();
    b.col(i) = truth[static_cast<std::size_t>(i)].translation();
    if (i > 0) length += (b.col(i) - b.col(i - 1)).norm();
  }
  const Eigen::Matrix4d alignment = Eigen::umeyama(a, b, false);
  const Eigen::Matrix3Xd aligned =
      (alignment.topLeftCorner<3, 3>() * a).colwise() + alignment.topRightCorner<3, 1>().col(0);
  error.ate = std::sqrt((aligned - b).colwise().squaredNorm().mean());
  const Pose difference =
      (truth.front().inverse() * truth.back()).inverse() * (estimate.front().inverse() * estimate.back());
  error.end = difference.translation().norm();
  error.end_percent = length > 0.0 ? 100.0 * error.end / length : 0.0;
  error.end_degrees = so3_log(difference.linear()).norm() * 180.0 / std::numbers::pi;
  return error;
}

}  // namespace adit::lidar_odometry
