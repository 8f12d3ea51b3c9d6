// A recorded folder of thermal images, with or without clouds and calibration, as messages for the offline runner.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "bringup/commands/odometry_output.hpp"
#include "components/dataset/dataset.hpp"
#include "components/geometry/trajectory.hpp"
#include "components/runtime/offline_runner.hpp"
#include "components/runtime/value.hpp"

namespace adit {

// What stands beside the images (components/tunnel_simulator/README.md): calib.txt and extrinsics.yaml, each optional.
struct ThermalFolder {
  dataset::Dataset images;
  dataset::Dataset clouds;  // no entries: none
  Value::Map parameters;    // camera_matrix, image_size, distortion, thermal_pose, lidar_pose, as far as known
  double row_time = 0.0;    // s
  double time_constant = 0.0;
};

// `rate_hz` is for images without stamps. Errors name the file.
Result<ThermalFolder> open_thermal_folder(const std::string& folder, double rate_hz);

// Frames by their stamp (middle of the readout), a cloud when its sweep is over, a prior when it is due.
class ThermalFolderSource final : public OfflineSource {
 public:
  ThermalFolderSource(ThermalFolder folder, Trajectory prior);
  Result<bool> next(OfflineMessage& out) override;

  const std::vector<FileTiming>& timing() const { return timing_; }
  std::size_t frames() const { return folder_.images.entries.size(); }

 private:
  using Steady = std::chrono::steady_clock;
  Result<void> read_cloud();
  Result<void> read_frame(OfflineMessage& out);
  void show_progress() const;

  ThermalFolder folder_;
  Trajectory prior_;
  std::size_t next_prior_ = 0;
  std::size_t next_cloud_ = 0;
  std::size_t next_frame_ = 0;
  std::optional<OfflineMessage> cloud_;  // read ahead
  std::optional<Steady::time_point> handed_out_;
  std::vector<FileTiming> timing_;
};

}  // namespace adit
