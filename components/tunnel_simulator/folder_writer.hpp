// Writes a run as the plain files the offline tools read (layout: README.md).
#pragma once

#include <fstream>
#include <optional>
#include <string>

#include "components/tunnel_simulator/simulation.hpp"

namespace adit::tunnel_simulator {

// 16-bit grey PNG.
Result<void> write_png16(const std::string& path, int width, int height, const std::vector<std::uint16_t>& pixels);

class FolderWriter final : public Sink {
 public:
  // Creates `folder` and its sub-folders; files of an earlier run are replaced.
  static Result<std::unique_ptr<FolderWriter>> open(const std::string& folder, const Simulation& simulation);

  void on_lidar(const LidarScan& scan, const Delivery& delivery) override;
  void on_thermal(const ThermalImage& image, const Delivery& delivery) override;
  void on_imu(const ImuSample& sample, const Delivery& delivery) override;
  void on_gnss(const GnssSample& sample, const Delivery& delivery) override;
  void on_truth(double time, const Pose& world_base) override;
  bool stop() override { return error_.has_value(); }
  // Flushes; the first failure, if there was one.
  Result<void> finish();

 private:
  FolderWriter(std::string folder, const Simulation& simulation)
      : folder_(std::move(folder)), simulation_(simulation) {}
  Result<void> write_calibration();

  std::string folder_;
  const Simulation& simulation_;
  std::ofstream scan_index_, lidar_start_, lidar_middle_, lidar_end_, times_, thermal_table_, thermal_truth_, imu_,
      gnss_, base_;
  std::vector<float> buffer_;
  std::uint64_t scans_ = 0, images_ = 0;
  std::optional<Error> error_;
};

}  // namespace adit::tunnel_simulator
