// Writes a run as a rosbag2 bag of the messages the component publishes, each stamped with its arrival.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "components/dataset/bag_writer.hpp"
#include "components/tunnel_simulator/simulation.hpp"

namespace adit::tunnel_simulator {

class BagSink final : public Sink {
 public:
  // Topics: /tf_static, /ground_truth/odometry, and of the sensors that are on /lidar/points, /thermal/frame,
  // /thermal/camera_info, /imu, /gnss/fix; with `plain_images` also /thermal/image_raw. `simulation` outlives the sink.
  static Result<std::unique_ptr<BagSink>> create(const std::string& folder, const Simulation& simulation,
                                                 bool plain_images);
  ~BagSink() override;

  void on_lidar(const LidarScan& scan, const Delivery& delivery) override;
  void on_thermal(const ThermalImage& image, const Delivery& delivery) override;
  void on_imu(const ImuSample& sample, const Delivery& delivery) override;
  void on_gnss(const GnssSample& sample, const Delivery& delivery) override;
  void on_truth(double time, const Pose& world_base) override;
  bool stop() override;
  // Ends the bag; the first failure, if there was one.
  Result<void> finish();

 private:
  struct Messages;
  BagSink(std::unique_ptr<dataset::BagWriter> writer, const Simulation& simulation, bool plain_images);
  template <class Message>
  void write(const std::string& topic, const Message& message, std::int64_t stamp_ns, bool latched = false);

  std::unique_ptr<dataset::BagWriter> writer_;
  const Simulation& simulation_;
  bool plain_images_;
  std::unique_ptr<Messages> messages_;  // reused from sample to sample
  std::vector<std::byte> bytes_;
  std::optional<Error> error_;
};

}  // namespace adit::tunnel_simulator
