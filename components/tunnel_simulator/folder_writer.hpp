// Writes a run as the plain files the offline tools read (layout: README.md).
#pragma once

#include <fstream>
#include <optional>
#include <string>

#include "components/dataset/png16.hpp"
#include "components/dataset/point_file.hpp"
#include "components/tunnel_simulator/simulation.hpp"

namespace adit::tunnel_simulator {

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
  dataset::PointFile cloud_{dataset::standard_fields(6), 0, {}};
  dataset::Image16 image_;
  std::uint64_t scans_ = 0, images_ = 0;
  std::optional<Error> error_;
};

}  // namespace adit::tunnel_simulator
