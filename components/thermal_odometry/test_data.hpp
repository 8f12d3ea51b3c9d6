// Recorded sequences for tests and benchmarks: 16-bit PNG files with their stamps, found beside the source tree.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "components/dataset/png16.hpp"
#include "components/geometry/trajectory.hpp"
#include "components/thermal_odometry/frame.hpp"

namespace adit::thermal_odometry {

// The folder, or an empty path: then the caller skips.
inline std::filesystem::path shared_data(const std::string& name) {
  const char* variable = std::getenv("ADIT_SHARED");
  const std::filesystem::path root =
      variable != nullptr ? variable : std::filesystem::path(ADIT_SOURCE_DIR) / ".." / "shared";
  const std::filesystem::path folder = root / "data" / name;
  return std::filesystem::exists(folder) ? folder : std::filesystem::path();
}

struct Recorded {
  int width = 0;
  int height = 0;
  std::vector<std::uint16_t> pixels;
  Frame at(std::int64_t stamp_ns) const { return {pixels.data(), width, height, 0, stamp_ns, FfcState::unknown}; }
};

// Grey PNG with 16 bits; empty on any failure.
inline Recorded read_png16(const std::filesystem::path& path) {
  Result<dataset::Image16> image = dataset::read_png16(path.string());
  if (!image) return {};
  return {static_cast<int>(image->width), static_cast<int>(image->height), std::move(image->pixels)};
}

inline Recorded read_frame(const std::filesystem::path& folder, int index) {
  char name[32];
  std::snprintf(name, sizeof name, "%06d.png", index);
  return read_png16(folder / "images" / name);
}

// Least-squares Sim(3) or SE(3) of estimate onto truth (Umeyama 1991) and the RMS of what remains.
struct Alignment {
  double rmse = 0.0;
  double scale = 1.0;
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
};
inline Alignment align(const std::vector<Pose>& estimate, const std::vector<Pose>& truth, bool with_scale) {
  const auto n = static_cast<Eigen::Index>(estimate.size());
  Eigen::Matrix3Xd from(3, n);
  Eigen::Matrix3Xd to(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    from.col(i) = estimate[static_cast<std::size_t>(i)].translation();
    to.col(i) = truth[static_cast<std::size_t>(i)].translation();
  }
  Alignment result;
  result.T = Eigen::umeyama(from, to, with_scale);
  result.scale = result.T.topLeftCorner<3, 1>().norm();
  const Eigen::Matrix3Xd rest =
      (result.T.topLeftCorner<3, 3>() * from).colwise() + Eigen::Vector3d(result.T.topRightCorner<3, 1>()) - to;
  result.rmse = std::sqrt(rest.squaredNorm() / static_cast<double>(n));
  return result;
}

// Mean relative position error over segments of `length` metres of the truth, lengths of the estimate times `scale`.
inline double relative_error(const std::vector<Pose>& estimate, const std::vector<Pose>& truth, double length,
                             double scale, double* rotation_deg_per_100m = nullptr) {
  double sum = 0.0;
  double angle = 0.0;
  int n = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    double path = 0.0;
    std::size_t j = i;
    while (j + 1 < truth.size() && path < length) {
      path += (truth[j + 1].translation() - truth[j].translation()).norm();
      ++j;
    }
    if (path < length) break;
    Pose a = estimate[i].inverse() * estimate[j];
    a.translation() *= scale;
    const Pose b = truth[i].inverse() * truth[j];
    sum += (a.translation() - b.translation()).norm() / path;
    angle += so3_log(a.rotation().transpose() * b.rotation()).norm() / path;
    ++n;
  }
  if (rotation_deg_per_100m != nullptr && n > 0) *rotation_deg_per_100m = angle / n * 100.0 * 180.0 / M_PI;
  return n > 0 ? sum / n : -1.0;
}

}  // namespace adit::thermal_odometry
