// For tests and studies only: recorded sweeps from the shared data folder, and the figures of a trajectory.
#pragma once

#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "components/geometry/trajectory.hpp"
#include "components/lidar_odometry/cloud.hpp"

namespace adit::lidar_odometry {

// Owns one sweep.
struct RecordedSweep {
  std::int64_t stamp_ns = 0;
  std::vector<Point3f> points;
  std::vector<float> seconds;        // empty: not in the recording
  std::vector<std::uint16_t> rings;  // empty: not in the recording
  std::size_t width = 0, height = 1;
  Cloud cloud() const;
};

// Absolute path of <shared>/data/<name>, <shared> being $ADIT_SHARED or ../shared beside the source tree; nothing if it
// is not there.
std::optional<std::string> shared_data(const std::string& name);

// All sweeps of FOLDER/scans, listed by index.txt (file, stamp, count), as float32 records of 4 to 6 columns:
// x, y, z, intensity[, t_rel[, ring]]. stamp_unit_ns: of the stamp column (0: the index has none, sweeps are 0.1 s
// apart).
std::vector<RecordedSweep> read_sweeps(const std::string& folder, std::int64_t stamp_unit_ns = 1);

// The same one by one, for recordings that do not fit into memory.
class SweepReader {
 public:
  explicit SweepReader(const std::string& folder, std::int64_t stamp_unit_ns = 1);
  std::optional<RecordedSweep> next();

 private:
  std::string folder_;
  std::int64_t stamp_unit_ns_;
  std::ifstream index_;
  std::int64_t count_ = 0;
};

// Vertices of a binary little-endian PLY file of float x, y, z, scalar.
std::vector<Point3f> read_ply(const std::string& path);

// Of this process, as the kernel counts it now.
double resident_megabytes();

struct TrajectoryError {
  double ate = 0.0;          // m, root mean square after rigid alignment of the positions
  double end = 0.0;          // m, of the last position with the first poses made equal
  double end_percent = 0.0;  // of the path
  double end_degrees = 0.0;
};
// Pose by pose (equal counts); nothing is interpolated.
TrajectoryError trajectory_error(const std::vector<Pose>& truth, const std::vector<Pose>& estimate);

}  // namespace adit::lidar_odometry
