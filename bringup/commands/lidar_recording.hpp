// Recorded clouds and inertial samples for the LiDAR odometry offline.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bringup/commands/odometry_output.hpp"
#include "components/geometry/trajectory.hpp"
#include "components/runtime/offline_runner.hpp"
#include "components/runtime/value.hpp"

namespace adit {

struct LidarRecordingOptions {
  double file_rate = 10.0;  // Hz, of folders without stamps
  Trajectory prior;         // on /prior, before the cloud of the same stamp; folders only
  std::string imu;          // folders: CSV of stamp [ns], specific force [m/s^2], rate [rad/s]; empty: none
};

// A folder (components/dataset) or a rosbag2 bag as /points and /imu. Of a bag its only topics of these types.
class LidarRecording : public OfflineSource {
 public:
  static Result<std::unique_ptr<LidarRecording>> open(const std::string& path, LidarRecordingOptions options);

  // Parameters that the recording itself tells: lidar_pose and imu_pose from a folder's extrinsics.yaml.
  virtual Value::Map parameters() const = 0;
  virtual bool has_imu() const = 0;

  // Notes how long the components worked on each cloud: until the next one is asked for, reading excluded.
  Result<bool> next(OfflineMessage& out) final;
  const std::vector<FileTiming>& timing() const { return timing_; }

 protected:
  virtual Result<bool> read(OfflineMessage& out) = 0;

 private:
  using Steady = std::chrono::steady_clock;
  std::optional<Steady::time_point> handed_out_;
  std::vector<FileTiming> timing_;
};

}  // namespace adit
